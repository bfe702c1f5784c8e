//! Pipes that frames go through.

/// Room that a pipe is given, in bytes: all that fits the caches beside a frame's rows.
#[cfg(target_os = "linux")]
const ROOM: usize = 1 << 18;

/// Gives a pipe more room, so that the programs at its ends wait for each other less often: a frame
/// is many times larger than a pipe. What already has as much, or is no pipe, stays as it
/// is, and so does everything on systems other than Linux.
#[cfg(target_os = "linux")]
pub fn widen(pipe: &impl std::os::fd::AsFd) {
    use rustix::pipe::{fcntl_getpipe_size, fcntl_setpipe_size};
    if fcntl_getpipe_size(pipe).is_ok_and(|room| room < ROOM) {
        // Refused where a user has too many pipes of that size: frames pass all the same.
        let _ = fcntl_setpipe_size(pipe, ROOM);
    }
}

/// Does nothing: only Linux has pipes whose room can be chosen.
#[cfg(not(target_os = "linux"))]
pub fn widen<T>(_pipe: &T) {}
