//! Where a user's files are.

use etcetera::app_strategy::{AppStrategy, AppStrategyArgs, choose_app_strategy};
use std::env;
use std::path::PathBuf;

/// Folders of the user. They need not be there yet.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Folders {
    /// Settings; `ILTM_CONFIG_DIR` takes precedence over the system's place.
    pub config: PathBuf,
    /// What is kept between two commands; likewise `ILTM_STATE_DIR`.
    pub state: PathBuf,
}

impl Folders {
    /// The folders of whoever runs this; none without a home folder.
    #[must_use]
    pub fn of_user() -> Option<Self> {
        let strategy = choose_app_strategy(AppStrategyArgs {
            top_level_domain: String::new(),
            author: String::new(),
            app_name: "iltm".to_owned(),
        });
        let given = |name| env::var_os(name).filter(|path| !path.is_empty());
        let given = |name| given(name).map(PathBuf::from);
        let usual = strategy.as_ref().ok();
        Some(Self {
            config: given("ILTM_CONFIG_DIR").or_else(|| usual.map(AppStrategy::config_dir))?,
            state: given("ILTM_STATE_DIR").or_else(|| {
                // Where the system has no place for state it goes with the caches' kin.
                usual.map(|usual| usual.state_dir().unwrap_or_else(|| usual.data_dir()))
            })?,
        })
    }
}
