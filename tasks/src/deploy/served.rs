//! The simulator as a robot that speaks ROS 2, and the judge of whoever drives it.

use crate::assemble::{Bare, Judged, assemble_bare};
use crate::error::TaskError;
use crate::run::{CELL_M, Progress, RunSpec};
use crate::summary::{Failure, Stage, StepSummary, Summary};
use crate::verdict::{Told, judged};
use dsm::map::Map;
use dsm::store::decode;
use dsm::time::{Span, Stamp};
use dsm_robot::model::ros2::{ClockSource, Ros2Settings};
use dsm_ros2::messages::Account;
use dsm_ros2::server::{Host, Server};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::time::Duration;

pub use dsm_ros2::server::Weather;

/// Control period of a robot whose clock runs by itself.
const PERIOD: Span = Span(10_000_000);

/// How a robot is served.
#[derive(Clone, Debug)]
pub struct Service {
    /// Names and ways.
    pub settings: Ros2Settings,
    /// What happens to messages on the way.
    pub weather: Weather,
    /// Whoever is silent for so long, real time, is away.
    pub patience: Duration,
}

/// What a service came to.
pub struct Served {
    /// The judge's account.
    pub summary: Summary,
    /// The map as the task told it; empty when it did not.
    pub map: Map,
}

/// Serves the robot of `spec` until the task has told its account, is away, or `interrupted` is set, and judges.
///
/// # Errors
/// [`TaskError`]: the world cannot be built, there is no DDS, or an account that cannot be read.
pub fn serve(
    spec: &RunSpec,
    service: &Service,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Served, TaskError> {
    let Bare { mut robot, model, mut detector, judged: watched, words } = assemble_bare(spec, None)?;
    let mut server = Server::start(model.clone(), service.settings.clone(), service.weather)?;
    tracing::warn!("{} waits for a task in DDS domain {}", model.settings.name, service.settings.domain);
    let patience = service.patience;
    let mut host = Judging { watched, words, progress, interrupted, patience, is_away: false, account: None };
    let ended = match service.settings.clock {
        ClockSource::LockStep => server.serve_steps(robot.as_mut(), detector.as_mut(), &mut host),
        ClockSource::Wall | ClockSource::Topic => {
            server.serve_freely(robot.as_mut(), detector.as_mut(), PERIOD, &mut host)
        }
    };
    ended.map_err(|error| TaskError::Internal(error.to_string()))?;
    host.watched.observe();
    let (steps, failure, map) = host.read_account()?;
    let told = Told { steps, failure, map: &map };
    let summary = judged(spec, model.settings.name.clone(), &host.watched.judge, told);
    Ok(Served { summary, map })
}

/// Follows the run for the judge.
struct Judging {
    watched: Judged,
    words: Sender<String>,
    progress: Box<dyn Progress>,
    interrupted: Arc<AtomicBool>,
    patience: Duration,
    is_away: bool,
    account: Option<Account>,
}

impl Host for Judging {
    fn goes_on(&mut self, now: Stamp, silent: Option<Duration>) -> bool {
        self.watched.observe();
        self.progress.at(now.as_s());
        self.is_away = silent.is_some_and(|silent| silent > self.patience);
        self.account.is_none() && !self.is_away && !self.interrupted.load(Ordering::Relaxed)
    }

    fn hear(&mut self, line: String) {
        // Nobody waits for words any more: then nobody needs them.
        let _ = self.words.send(line);
    }

    fn take_account(&mut self, account: Account) {
        self.account = Some(account);
    }
}

/// Steps, the first failure and the map.
type Read = (Vec<StepSummary>, Option<Failure>, Map);

impl Judging {
    fn read_account(&self) -> Result<Read, TaskError> {
        let Some(account) = &self.account else {
            let why = if self.is_away { "the task is silent and has told no account" } else { "interrupted" };
            let failure = Failure { step: 0, stage: Stage::Crash, reason: why.into() };
            return Ok((Vec::new(), Some(failure), Map::new(CELL_M)));
        };
        let unread = |error: serde_json::Error| TaskError::Usage(format!("/dsm/account: {error}"));
        let steps = serde_json::from_str(&account.steps).map_err(unread)?;
        let failure = serde_json::from_str(&account.failure).map_err(unread)?;
        Ok((steps, failure, decode(&account.map, Path::new("/dsm/account"))?.map))
    }
}
