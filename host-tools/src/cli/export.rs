//! `iltm export`

use super::args::{Export, Player};
use super::failure::Failure;
use super::output::Output;
use super::tables::{check, read_table, table_has};
use crate::compile::shader::user_shader;
use iltm_picture::{WholeFolder, check_free};
use serde_json::json;

/// What the shader's file is called.
const SHADER: &str = "iltm.glsl";

pub(super) fn run(arguments: &Export, output: &Output) -> Result<(), Failure> {
    let out = &arguments.output;
    check_free(out)?;
    let image = read_table(&arguments.table)?;
    let table = check(&arguments.table, &image)?;
    let tier = arguments.tier.unwrap_or_else(|| table.top_tier());
    table_has(&table, tier)?;
    let Player::Mpv = arguments.player;
    let shader = user_shader(&table, tier);
    let folder = WholeFolder::create(out)?;
    folder.file(SHADER, &shader)?;
    folder.finish()?;
    let path = out.join(SHADER);
    let data = json!({
        "folder": out.display().to_string(),
        "files": [SHADER],
        "tier": tier,
        "bytes": shader.len(),
    });
    let text = format!(
        "written     {}: tier {tier}, {} bytes\n\
         next        mpv --fullscreen --glsl-shader={} FILM\n",
        path.display(),
        shader.len(),
        path.display(),
    );
    output.result(&data, &text);
    Ok(())
}
