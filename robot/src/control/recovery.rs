//! Leaving a local minimum: another posture for the same goal, searched a few steps a tick.
//!
//! ```text
//! new standing goal ─▶ descent from here: does it arrive? ── no ─┐
//!                  └▶ further descents from drawn starts ─▶ postures, the quickest to reach first
//! no progress, too late, or the descent from here failed ─▶ straight to the quickest posture ─▶ follow the pose again
//! ```
//!
//! Everything is bounded and depends on nothing but goal and states: so many descent steps a tick, so many starts and
//! so many moves for one goal.

use super::descent::{Chain, Descent};
use dsm::Pose;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Descent steps a tick; a step takes one to two microseconds.
const STEPS_PER_TICK: usize = 96;
/// Steps after which a descent is given up.
const STEPS_PER_START: usize = 80;
/// Distance and angle from the goal that do after the last step: near singular postures steps are short.
const NEAR_M: f64 = 1e-3;
/// See [`NEAR_M`].
const NEAR_RAD: f64 = 5e-3;
/// Drawn starts for one goal.
const MAX_STARTS: usize = 40;
/// Postures kept for one goal; with so many the quickest is taken.
const ENOUGH: usize = 8;
/// Moves for one goal.
const MAX_MOVES: usize = 4;
/// Without progress for this long a motion is stuck, s.
const PATIENCE_S: f64 = 0.35;
/// Part of what the gain would take off the error within that time that must go.
const PROGRESS: f64 = 0.35;
/// Part of the way that the tool could go in that time that is as good.
const PROGRESS_OF_WAY: f64 = 0.1;
/// How many times the expected time for the way a motion may take before it counts as stuck.
const LATE: f64 = 1.2;
/// Joint error at which the pose task takes over again, rad or m.
const HANDED_OVER: f64 = 0.01;

/// What the controller shall do.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Advice {
    /// Follow the pose.
    Follow,
    /// Go straight to these joint values.
    MoveTo(Vec<f64>),
}

/// How a tick stands.
pub(super) struct Progress<'a> {
    pub(super) goal: &'a Pose,
    pub(super) positions: &'a [f64],
    /// Greatest speed of each joint.
    pub(super) speeds: &'a [f64],
    /// Distance and angle from the goal, the angle weighted as a length.
    pub(super) error: f64,
    pub(super) reached: bool,
    /// Gain of the pose task, 1/s, and greatest speed of the tool, m/s.
    pub(super) rates: (f64, f64),
    /// Whether obstacles or own links held the last motion back.
    pub(super) held_back: bool,
    pub(super) dt_s: f64,
}

/// Watches whether a number falls.
#[derive(Clone, Debug)]
struct Watchdog {
    best: f64,
    without_progress_s: f64,
}

impl Watchdog {
    const NEW: Self = Self { best: f64::INFINITY, without_progress_s: 0.0 };

    /// Whether the number has not fallen for too long; it falls by the share `gain_per_s`, and by `most_per_s` at most.
    fn is_stuck(&mut self, value: f64, (gain_per_s, most_per_s): (f64, f64), dt_s: f64) -> bool {
        let by_gain = self.best * (1.0 - (-gain_per_s * PATIENCE_S).exp());
        let progress = (PROGRESS * by_gain).min(PROGRESS_OF_WAY * most_per_s * PATIENCE_S);
        if self.best == f64::INFINITY || value < self.best - progress {
            *self = Self { best: value, without_progress_s: 0.0 };
        } else {
            self.without_progress_s += dt_s;
        }
        self.without_progress_s > PATIENCE_S
    }
}

/// The search for one goal, and where the arm is in it.
pub(super) struct Recovery {
    chain: Chain,
    goal: Option<Pose>,
    rng: ChaCha8Rng,
    /// The running descent and its steps.
    descent: Option<(Descent, usize)>,
    starts: usize,
    /// Whether the descent from where the arm stood arrives.
    from_here: Option<bool>,
    postures: Vec<Vec<f64>>,
    moving_to: Option<Vec<f64>>,
    /// The posture found from where the arm stood, or the one moved to last: it reaches the goal.
    hint: Option<Vec<f64>>,
    moves: usize,
    watchdog: Watchdog,
    /// How long the pose was followed, and how long that should take, s.
    followed_s: f64,
    due_s: f64,
}

impl Recovery {
    pub(super) fn new(chain: Chain) -> Self {
        Self {
            chain,
            goal: None,
            rng: ChaCha8Rng::seed_from_u64(0),
            descent: None,
            starts: 0,
            from_here: None,
            postures: Vec::new(),
            moving_to: None,
            hint: None,
            moves: 0,
            watchdog: Watchdog::NEW,
            followed_s: 0.0,
            due_s: f64::INFINITY,
        }
    }

    /// A posture that reaches the goal, for the posture task: with another one that may hold the arm off it. Unless the
    /// arm has moved to it, it gives way to a posture that the caller chose.
    pub(super) fn find_hint(&self, chosen: bool) -> Option<&[f64]> {
        self.hint.as_deref().filter(|_| self.moves > 0 || !chosen)
    }

    /// Forgets the goal.
    pub(super) fn reset(&mut self) {
        self.goal = None;
        self.hint = None;
    }

    /// What to do in this tick; `fits` tells whether a posture touches nothing.
    pub(super) fn advise(&mut self, progress: &Progress<'_>, fits: impl Fn(&[f64]) -> bool) -> Advice {
        if self.goal.as_ref() != Some(progress.goal) {
            self.begin(progress);
        }
        if progress.reached {
            self.moving_to = None;
            return Advice::Follow;
        }
        self.search(progress, fits);
        if let Some(target) = &self.moving_to {
            let left = target.iter().zip(progress.positions).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let left_s = time_s(target, progress);
            if left > HANDED_OVER && !self.watchdog.is_stuck(left_s, (f64::INFINITY, 1.0), progress.dt_s) {
                return Advice::MoveTo(target.clone());
            }
            self.moving_to = None;
            self.watchdog = Watchdog::NEW;
            // A new judgement from here would only repeat the one before.
            self.from_here = Some(true);
            self.followed_s = 0.0;
        }
        self.followed_s += progress.dt_s;
        let stuck =
            self.watchdog.is_stuck(progress.error, progress.rates, progress.dt_s) || self.followed_s > self.due_s;
        let hopeless = self.from_here == Some(false) && (self.postures.len() >= ENOUGH || self.starts >= MAX_STARTS);
        if !(stuck || hopeless) || progress.held_back || self.moves >= MAX_MOVES || self.postures.is_empty() {
            return Advice::Follow;
        }
        let quickest = (0..self.postures.len()).min_by(|a, b| {
            let time_s = |k: usize| time_s(&self.postures[k], progress);
            time_s(*a).total_cmp(&time_s(*b))
        });
        let target = quickest.map(|k| self.postures.swap_remove(k));
        self.moves += 1;
        self.watchdog = Watchdog::NEW;
        self.moving_to.clone_from(&target);
        self.hint.clone_from(&target);
        target.map_or(Advice::Follow, Advice::MoveTo)
    }

    fn begin(&mut self, progress: &Progress<'_>) {
        self.goal = Some(*progress.goal);
        self.rng = ChaCha8Rng::seed_from_u64(0);
        self.descent = Some((Descent::new(&self.chain, progress.positions.to_vec()), 0));
        self.starts = 0;
        self.from_here = None;
        self.postures.clear();
        self.moving_to = None;
        self.hint = None;
        self.moves = 0;
        self.watchdog = Watchdog::NEW;
        self.followed_s = 0.0;
        self.due_s = f64::INFINITY;
    }

    /// A few steps of the search; an arrived posture ends the tick's share.
    fn search(&mut self, progress: &Progress<'_>, fits: impl Fn(&[f64]) -> bool) {
        for _ in 0..STEPS_PER_TICK {
            let Some((descent, steps)) = &mut self.descent else {
                if self.starts >= MAX_STARTS || self.postures.len() >= ENOUGH {
                    return;
                }
                self.starts += 1;
                let rng = &mut self.rng;
                let start = self.chain.ranges.iter().map(|(lower, upper)| rng.random_range(*lower..=*upper)).collect();
                self.descent = Some((Descent::new(&self.chain, start), 0));
                continue;
            };
            *steps += 1;
            let arrived = match descent.step(&self.chain, progress.goal) {
                Some(true) => true,
                Some(false) if *steps < STEPS_PER_START => continue,
                _ => descent.error.0 < NEAR_M && descent.error.1 < NEAR_RAD,
            };
            let values = std::mem::take(&mut descent.values);
            self.descent = None;
            if self.from_here.is_none() {
                self.from_here = Some(arrived);
                if arrived && fits(&values) {
                    let joints_s = time_s(&values, progress);
                    let (gain_per_s, tool_m_per_s) = progress.rates;
                    let tool_s = progress.error / tool_m_per_s + 1.0 / gain_per_s;
                    self.due_s = LATE * joints_s.max(tool_s) + PATIENCE_S;
                    self.hint = Some(values.clone());
                    self.postures.push(values);
                }
            } else if arrived && fits(&values) {
                self.postures.push(values);
            }
            if arrived {
                return;
            }
        }
    }
}

/// How long the slowest joint takes.
fn time_s(target: &[f64], progress: &Progress<'_>) -> f64 {
    let joints = target.iter().zip(progress.positions).zip(progress.speeds);
    joints.map(|((a, b), speed)| (a - b).abs() / speed).fold(0.0, f64::max)
}
