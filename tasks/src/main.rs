//! The command line `dsm`.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(dsm_tasks::cli::start(std::env::args_os()))
}
