-- Keys, status line, counts and exchange of the table for `iltm play`. mpv runs this; iltm reads
-- what it prints, a JSON object a line.

local utils = require "mp.utils"
local folder = os.getenv("ILTM_PLAY")
local settings = dofile(folder .. "/settings.lua")

local state = {
    generation = 0, tier = settings.tier, tiers = settings.tiers,
    compensated = true, white = false, card = false, line = false,
}
local counts = { dropped = 0, late = 0, films = 0, failed = 0, shown = false }
local loaded, pictured, ending = false, false, false
-- mpv counts late frames only while it plays in step with the display.
local in_step = false

local function say(event)
    io.stdout:write(utils.format_json(event), "\n")
    io.stdout:flush()
end

local function finish(code)
    if not ending then
        ending = true
        mp.commandv("quit", code)
    end
end

-- What is wrong during a show is said, and ends it only if that is asked for.
local function trouble(event)
    say(event)
    if settings.strict then
        finish(5)
    end
end

local line = mp.create_osd_overlay("ass-events")

local function words()
    local how = state.card and "test card, as it is" or state.compensated
        and string.format("compensated, tier %d of %d", state.tier, state.tiers - 1)
        or "as it is"
    if state.white and not state.card then
        how = "white, " .. how
    end
    return how
end

local function show_line()
    if not state.line then
        line:remove()
        return
    end
    local name = mp.get_property("filename") or "nothing to play"
    local held = mp.get_property_native("pause") and "  paused" or ""
    line.data = string.format(
        "{\\an1\\fs22\\bord1}%s  %s%s  %d dropped%s",
        (name:gsub("[{}\\]", " ")), words(), held, counts.dropped,
        in_step and string.format(", %d late", counts.late) or ""
    )
    line:update()
end

-- Looks in a row, four a second, at which mpv has drawn a film without the table's shader: it leaves
-- shaders away where the graphics processor cannot keep what they need.
local without = 0
local function look_at_passes()
    local passes = mp.get_property_native("vo-passes") or { fresh = {}, redraw = {} }
    local drawn, compensated = false, false
    -- What stands still is drawn again only.
    for _, kind in ipairs({ passes.fresh, passes.redraw }) do
        for _, pass in ipairs(kind) do
            drawn = true
            compensated = compensated or pass.desc:find("iltm: pixels", 1, true)
        end
    end
    without = drawn and counts.shown and state.compensated and not compensated and without + 1 or 0
    if without == 20 then
        local format = mp.get_property("fbo-format")
        trouble({ problem = "nothing is compensated: mpv leaves the table's shader away; if the graphics "
            .. "processor cannot keep " .. format .. " between passes, try `-- --fbo-format=auto`" })
    end
end

local function apply()
    without = 0
    local shaders = {}
    if state.white then
        table.insert(shaders, folder .. "/white.glsl")
    end
    if state.compensated then
        table.insert(shaders, string.format("%s/%d-%d.glsl", folder, state.generation, state.tier))
    end
    mp.set_property_native("glsl-shaders", shaders)
    show_line()
end

local function changed()
    apply()
    mp.osd_message(words(), 2)
end

local function show_card()
    if state.card then
        mp.commandv(
            "overlay-add", 0, 0, 0, folder .. "/card.bgra", 0, "bgra",
            settings.width, settings.height, 4 * settings.width
        )
    else
        mp.commandv("overlay-remove", 0)
    end
end

local function key(name, what, act)
    mp.add_forced_key_binding(name, "iltm-" .. what, act, { repeatable = false })
end

local function toggle(name)
    return function()
        state[name] = not state[name]
        changed()
    end
end

local function tier(step)
    return function()
        state.tier = math.max(0, math.min(state.tiers - 1, state.tier + step))
        changed()
    end
end

key("c", "compensated", toggle("compensated"))
key("w", "white", toggle("white"))
key("t", "card", function()
    if settings.width == 0 then
        mp.osd_message("no test card: the table does not say the projector's pixels", 2)
        return
    end
    state.card = not state.card
    show_card()
    show_line()
end)
key("i", "line", function()
    state.line = not state.line
    show_line()
end)
key("+", "finer", tier(1))
key("-", "coarser", tier(-1))
key("SPACE", "pause", function() mp.commandv("cycle", "pause") end)
key("n", "next", function() mp.commandv("playlist-next", "weak") end)
key("p", "previous", function() mp.commandv("playlist-prev", "weak") end)
key("q", "quit", function() finish(0) end)
key("ESC", "escape", function() finish(0) end)

-- A player's counts begin again with each film.
local function count(property, what)
    local before = 0
    mp.observe_property(property, "number", function(_, now)
        now = now or 0
        counts[what] = counts[what] + math.max(0, now < before and now or now - before)
        before = now
        show_line()
    end)
end
count("frame-drop-count", "dropped")
count("decoder-frame-drop-count", "dropped")
count("vo-delayed-frame-count", "late")

mp.observe_property("pause", "bool", show_line)

-- The display fits, or nothing is shown; in mid show it may change, as when a cable is pulled.
local fits, watched = nil, false
local function look_at_display()
    local width, height = mp.get_osd_size()
    if settings.width == 0 or not width or width == 0 then
        return
    end
    local now = width == settings.width and height == settings.height
    if now == fits then
        return
    end
    local first = fits == nil
    fits = now
    if not now then
        local event = { display = { width = width, height = height } }
        if first then
            say(event)
            finish(6)
        else
            trouble(event)
        end
    end
end

-- A window takes a moment to fill the display, on a slow computer a few seconds.
local function wait_for_display(rest)
    local width, height = mp.get_osd_size()
    if rest > 0 and not (width == settings.width and height == settings.height) then
        mp.add_timeout(0.5, function() wait_for_display(rest - 1) end)
        return
    end
    look_at_display()
    mp.observe_property("osd-dimensions", "native", look_at_display)
end

-- Whether what plays now is heard: a sound device takes a moment as well.
local listening = nil
local function listen()
    listening = mp.add_timeout(2, function()
        local device = mp.get_property("current-ao")
        local silent = mp.get_property("ao") == "null"
        if not device or device == "null" and not silent then
            trouble({ problem = "there is no sound: no device plays it" })
        end
    end)
end

mp.register_event("file-loaded", function()
    loaded = true
    counts.films = counts.films + 1
    local picture, sound, turned = false, false, 0
    for _, track in ipairs(mp.get_property_native("track-list")) do
        if track.type == "video" and not track.albumart then
            picture = true
            turned = track["demux-rotation"] or 0
        end
        sound = sound or track.type == "audio" and track.selected
    end
    -- One film begins again without a gap. A stream would begin again with what was received before,
    -- and it cannot be opened twice.
    local several = mp.get_property_native("playlist-count") > 1
    local repeated = not several and not settings.once and mp.get_property_native("seekable")
        and not mp.get_property_native("demuxer-via-network")
    mp.set_property("loop-file", repeated and "inf" or "no")
    mp.set_property_native("prefetch-playlist", several)
    local film = mp.get_property("path")
    pictured = picture
    if not picture then
        counts.failed = counts.failed + 1
        trouble({ film = film, problem = "has no picture" })
    elseif turned ~= 0 then
        trouble({ film = film, problem = "lies on its side: turn it by " .. turned .. " degrees beforehand" })
    end
    if not watched then
        watched = true
        wait_for_display(8)
    end
    if sound then
        listen()
    end
    show_line()
end)

mp.register_event("playback-restart", function()
    counts.shown = counts.shown or pictured
end)

mp.register_event("end-file", function(event)
    if listening then
        listening:kill()
        listening = nil
    end
    if event.reason == "error" then
        if not loaded then
            counts.films = counts.films + 1
        end
        counts.failed = counts.failed + 1
        local film
        for _, item in ipairs(mp.get_property_native("playlist") or {}) do
            if item.id == event.playlist_entry_id then
                film = item.filename
            end
        end
        trouble({ film = film, problem = event.file_error or "cannot be played" })
    end
    loaded, pictured = false, false
end)

-- Nothing is left to play: the end, or a film that could not be played and may come back.
mp.observe_property("idle-active", "bool", function(_, idle)
    if not idle then
        return
    end
    if counts.films > 0 and (settings.once or not counts.shown) then
        finish(0)
    elseif counts.shown then
        mp.add_timeout(2, function()
            if mp.get_property_native("idle-active") then
                mp.commandv("playlist-play-index", 0)
            end
        end)
    end
end)

-- iltm puts the number of the newest table, and of its tiers, in a file, and another one where the
-- user wants an end. If iltm itself is gone, so is the folder.
local function there(name)
    local file = io.open(folder .. "/" .. name)
    return file and file:close()
end
mp.add_periodic_timer(0.25, function()
    look_at_passes()
    -- No event says so.
    in_step = in_step or mp.get_property_native("display-sync-active")
    if there("stop") or not there("settings.lua") then
        finish(0)
    end
    local file = io.open(folder .. "/newest")
    if not file then
        return
    end
    local generation, tiers = file:read("*n", "*n")
    file:close()
    if generation and tiers and generation ~= state.generation then
        local top = state.tier == state.tiers - 1
        state.generation, state.tiers = generation, tiers
        state.tier = top and tiers - 1 or math.min(state.tier, tiers - 1)
        apply()
        say({ table = generation })
    end
end)

mp.register_event("shutdown", function()
    counts.late = in_step and counts.late or nil
    say({ ended = counts })
end)

apply()
