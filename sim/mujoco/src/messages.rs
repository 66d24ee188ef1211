//! What MuJoCo says goes to stderr, like all that this program logs, instead of to a file in the working directory.
#![allow(unsafe_code, reason = "MuJoCo's handler is a global of its library")]

use mujoco_rs::prelude::{MjLogMessage, MjtLogLevel, set_log_handler};
use std::io::Write;
use std::sync::Once;

static ROUTED: Once = Once::new();

/// Routes the messages; to be called before anything else of MuJoCo is.
pub(crate) fn route_messages() {
    // SAFETY: every world begins with this call and nothing else here reaches MuJoCo before it, so no other thread uses
    // MuJoCo until the one and only call is done.
    ROUTED.call_once(|| unsafe { set_log_handler(write) });
}

fn write(message: &MjLogMessage) {
    let level = match message.level() {
        MjtLogLevel::mjLOG_ERROR => "ERROR",
        MjtLogLevel::mjLOG_WARNING => "WARN",
        _ => return,
    };
    // Whoever closed stderr does not want to read it.
    let _ = writeln!(std::io::stderr(), "{level} mujoco: {}", message.subject());
}
