//! Turns the head from gaze to gaze, with everything else at rest, so that the mounting of its camera can be estimated.

use crate::agent::{Agent, Gaze, Halt};
use dsm::time::Span;

/// Pans, radians to the left.
const PANS_RAD: [f64; 5] = [-0.6, -0.3, 0.0, 0.3, 0.6];
/// Tilts, radians down.
const TILTS_RAD: [f64; 3] = [0.05, 0.3, 0.55];
/// The head is still when it comes this close to its gaze, radians; where limits keep it off, patience ends it.
const CLOSE_RAD: f64 = 0.01;
/// Patience for one gaze.
const PATIENCE: Span = Span(3_000_000_000);
/// Rest at each gaze: a camera with five frames a second takes three.
const REST: Span = Span(600_000_000);

/// Looks along each gaze in turn; says how many.
pub fn wiggle(agent: &mut Agent) -> Result<String, Halt> {
    let before = agent.gaze;
    for (row, tilt_rad) in TILTS_RAD.into_iter().enumerate() {
        for place in 0..PANS_RAD.len() {
            // To and fro: the way between gazes stays short.
            let pan_rad = if row % 2 == 0 { PANS_RAD[place] } else { PANS_RAD[PANS_RAD.len() - 1 - place] };
            agent.gaze = Gaze::Angles { pan_rad, tilt_rad };
            let end = agent.now() + PATIENCE;
            while agent.now() < end && (agent.pan_rad()? - pan_rad).abs() > CLOSE_RAD {
                agent.rest(agent.period())?;
            }
            agent.rest(REST)?;
        }
    }
    agent.gaze = before;
    Ok(format!("{} gazes", PANS_RAD.len() * TILTS_RAD.len()))
}
