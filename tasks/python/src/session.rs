//! A run in the hands of a Python program: the robot with its senses, its map and its skills.
//!
//! ```text
//! Python thread ──job──▶ the session's own thread, which alone holds agent, map and judge
//!        ▲ └─ looks for signals while it waits, without the interpreter lock
//!        └──────reply──────┘
//! ```

use crate::driver::own_robot;
use crate::error::{InputError, RunError, raised};
use crate::frame::Frame;
use crate::interrupt::{Heeding, Interrupt};
use crate::map::Map;
use crate::plain::to_python;
use crate::plugged::{Plugs, plugged};
use crate::process::check_process;
use crate::senses::Senses;
use crate::spec::{Asked, spec_of};
use crate::world::{commands_of, duration_of, joints_of};
use dsm::time::Span;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::{JointNames, JointVelocities};
use dsm_tasks::agent::{Agent, Halt};
use dsm_tasks::episode::{SkillName, Step};
use dsm_tasks::error::TaskError;
use dsm_tasks::language::Language;
use dsm_tasks::run::RunSpec;
use dsm_tasks::session::{Keep, Session as Run};
use dsm_tasks::summary::Summary;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Something to do with the run, on its own thread.
enum Job {
    Do(Box<dyn FnOnce(&mut Run) + Send>),
    Finish(Sender<Result<Ended, TaskError>>),
}

/// What is left of a run that is over.
struct Ended {
    summary: Summary,
    map: Arc<dsm::map::Map>,
}

/// What is known of a run that goes on, or is over.
enum State {
    Running(Sender<Job>),
    Finished(Box<Ended>),
    Broken,
}

/// A run that goes on.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct Session {
    state: Mutex<State>,
    interrupt: Interrupt,
    arm: JointNames,
    language: Arc<dyn Language>,
    commands: Vec<String>,
    seed: u64,
}

/// Begins a run on a thread of its own, since what it holds stays on the thread that made it.
fn begin(
    spec: RunSpec,
    driver: Option<Py<PyAny>>,
    map_file: Option<PathBuf>,
    interrupt: &Interrupt,
) -> Result<(Sender<Job>, JointNames), TaskError> {
    let (sender, jobs) = channel();
    let (tell, begun) = channel();
    let interrupt = interrupt.clone();
    std::thread::spawn(move || {
        let progress = Box::new(Heeding::new(interrupt.clone()));
        let (file, flag) = (map_file.as_deref(), interrupt.flag.clone());
        let run = match driver {
            None => Run::begin(&spec, file, flag, progress),
            Some(driver) => own_robot(driver, &spec, &interrupt)
                .and_then(|own| Run::begin_on(own, &spec, file, Keep::default(), flag, progress)),
        };
        match run {
            Ok(mut run) => {
                // Who asked may be gone; then there are no jobs either.
                let _ = tell.send(Ok(run.agent().model().arm.joints.clone()));
                work(run, jobs);
            }
            Err(error) => drop(tell.send(Err(error))),
        }
    });
    let arm = begun.recv().map_err(|_| TaskError::Internal("the run broke while it began".into()))??;
    Ok((sender, arm))
}

fn work(mut run: Run, jobs: Receiver<Job>) {
    for job in jobs {
        match job {
            Job::Do(job) => job(&mut run),
            Job::Finish(reply) => {
                let ended = run.finish().map(|finished| Ended { summary: finished.summary, map: finished.map });
                // Who asked may be gone.
                let _ = reply.send(ended);
                return;
            }
        }
    }
}

/// Waits for a reply without the interpreter lock and heeds signals meanwhile: they end the run in order.
fn await_reply<T: Send>(py: Python<'_>, reply: Receiver<T>, interrupt: &Interrupt) -> PyResult<T> {
    const LOOK_EVERY: Duration = Duration::from_millis(50);
    let reply = Mutex::new(reply);
    loop {
        let answer = py.detach(|| match reply.lock() {
            Ok(reply) => reply.recv_timeout(LOOK_EVERY),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        match answer {
            Ok(value) => {
                interrupt.result()?;
                return Ok(value);
            }
            Err(RecvTimeoutError::Timeout) => {
                if let Err(error) = py.check_signals() {
                    interrupt.raise(error);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                interrupt.result()?;
                return Err(RunError::new_err("the run broke; its thread is gone"));
            }
        }
    }
}

fn halted(halt: Halt) -> PyErr {
    match halt {
        Halt::TimeUp => RunError::new_err("the simulated time limit is reached"),
        Halt::Interrupted => RunError::new_err("the run was interrupted; it can be finished"),
        Halt::Stopped(error) => raised(error.into()),
        Halt::Failed(error) => raised(error),
    }
}

impl Session {
    /// Does something with the run on its thread.
    fn with<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Run) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (tell, reply) = channel();
        let job = Job::Do(Box::new(move |run: &mut Run| drop(tell.send(work(run)))));
        match &*self.state.lock().map_err(|_| broken())? {
            State::Running(jobs) => jobs.send(job).map_err(|_| broken())?,
            State::Finished(_) => return Err(RunError::new_err("the session is finished")),
            State::Broken => return Err(broken()),
        }
        await_reply(py, reply, &self.interrupt)
    }

    fn run_step<'py>(&self, py: Python<'py>, step: Step) -> PyResult<Bound<'py, PyAny>> {
        let account = self.with(py, move |run| run.run(&[step]).last().cloned())?;
        to_python(py, &account.ok_or_else(broken)?)
    }
}

fn broken() -> PyErr {
    RunError::new_err("the run broke in an earlier call")
}

#[pymethods]
impl Session {
    /// Begins a run in a scene (its folder or MJCF file) or in that of an episode file, whose steps are not run by this.
    #[new]
    #[pyo3(signature = (path, *, seed=None, robot=None, physics=None, perception=None, start=None, expect=None,
        time_limit_s=None, backend=None, detector=None, language=None, driver=None, map_file=None))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        seed: Option<u64>,
        robot: Option<String>,
        physics: Option<&str>,
        perception: Option<&str>,
        start: Option<(f64, f64, f64)>,
        expect: Option<Bound<'_, PyAny>>,
        time_limit_s: Option<f64>,
        backend: Option<String>,
        detector: Option<Py<PyAny>>,
        language: Option<Py<PyAny>>,
        driver: Option<Py<PyAny>>,
        map_file: Option<PathBuf>,
    ) -> PyResult<Self> {
        check_process()?;
        let asked = Asked::new(path, seed, robot, physics, perception, start, expect.as_ref())?;
        let asked = asked.within(time_limit_s, backend);
        let interrupt = Interrupt::default();
        let plugs = Plugs::new(py, detector, language)?;
        let told = interrupt.clone();
        let begun = py.detach(|| {
            let mut spec = spec_of(asked)?;
            spec.language = plugged(spec.language, plugs, &interrupt);
            let (language, commands, seed) = (spec.language.clone(), commands_of(&spec.episode), spec.seed);
            let (jobs, arm) = begin(spec, driver, map_file, &interrupt)?;
            let state = Mutex::new(State::Running(jobs));
            Ok::<_, TaskError>(Self { state, interrupt, arm, language, commands, seed })
        });
        told.result()?;
        begun.map_err(raised)
    }

    /// Runs a command in English, as a step of an episode, and accounts for it. After a step that failed the rest is
    /// skipped until `forgive`.
    fn run<'py>(&self, py: Python<'py>, command: String) -> PyResult<Bound<'py, PyAny>> {
        if command.trim().is_empty() {
            return Err(InputError::new_err("command is empty; expected English words"));
        }
        self.run_step(py, Step::command(command))
    }

    /// Sees all that can be reached.
    fn explore<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.run_step(py, Step { skill: Some(SkillName::Explore), ..Step::default() })
    }

    /// Drives to an object or a room, named in words.
    fn navigate<'py>(&self, py: Python<'py>, target: String) -> PyResult<Bound<'py, PyAny>> {
        self.run_step(py, Step { skill: Some(SkillName::Navigate), target: Some(target), ..Step::default() })
    }

    /// Drives to an object, named in words, and lifts it.
    fn grasp<'py>(&self, py: Python<'py>, target: String) -> PyResult<Bound<'py, PyAny>> {
        self.run_step(py, Step { skill: Some(SkillName::Grasp), target: Some(target), ..Step::default() })
    }

    /// Forgets that a step failed: what comes next is begun all the same. The accounts stay.
    fn forgive(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, Run::forgive)
    }

    /// Moves base, arm and gripper for a while, beside the skills; the head looks where its gaze is, and the map grows.
    #[pyo3(signature = (*, base=(0.0, 0.0), arm=None, gripper=None, duration_s=0.01))]
    fn step(
        &self,
        py: Python<'_>,
        base: (f64, f64),
        arm: Option<Vec<f64>>,
        gripper: Option<(f64, f64)>,
        duration_s: f64,
    ) -> PyResult<()> {
        let arm = joints_of(&self.arm, arm)?;
        let base = Twist { forward_m_per_s: base.0, turn_rad_per_s: base.1 };
        let duration = duration_of(duration_s)?;
        self.with(py, move |run| tick(run.agent(), base, &arm, gripper, duration))?.map_err(halted)
    }

    /// The newest picture of a camera, None before the first. Of all cameras the head's is always read.
    #[pyo3(signature = (camera="head"))]
    fn frame(&self, py: Python<'_>, camera: &str) -> PyResult<Option<Frame>> {
        let camera = camera.to_owned();
        let find = move |run: &mut Run| run.agent().find_frame(&camera).map(|seen| seen.frame.clone());
        Ok(self.with(py, find)?.map(Frame::new))
    }

    /// All that the robot feels: a dictionary of numbers and arrays.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.with(py, |run| Senses::of_agent(run.agent()))?.map_err(halted)?.to_python(py)
    }

    /// What the judge says of the expectations at this moment; empty where nobody judges.
    fn judge<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.with(py, |run| run.judged())?)
    }

    /// The map as it is known at this moment, or at the end.
    #[getter]
    fn map(&self, py: Python<'_>) -> PyResult<Map> {
        let finished = match &*self.state.lock().map_err(|_| broken())? {
            State::Finished(finished) => Some(finished.map.clone()),
            _ => None,
        };
        let map = match finished {
            Some(map) => map,
            None => self.with(py, |run| run.agent().map().clone())?,
        };
        Ok(Map { map, language: Some(self.language.clone()) })
    }

    /// Simulated seconds since the run began.
    #[getter]
    fn time_s(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |run| run.agent().now().as_s())
    }

    /// The seed of every draw.
    #[getter]
    fn seed(&self) -> u64 {
        self.seed
    }

    /// The commands of the episode file, in order; empty for a scene.
    #[getter]
    fn commands(&self) -> Vec<String> {
        self.commands.clone()
    }

    /// Ends the run, lets things come to rest under the eyes of the judge, and gives the summary; again, if it is asked
    /// again.
    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (tell, reply) = channel();
        {
            let mut state = self.state.lock().map_err(|_| broken())?;
            match std::mem::replace(&mut *state, State::Broken) {
                State::Running(jobs) => jobs.send(Job::Finish(tell)).map_err(|_| broken())?,
                State::Finished(finished) => {
                    let summary = to_python(py, &finished.summary);
                    *state = State::Finished(finished);
                    return summary;
                }
                State::Broken => return Err(broken()),
            }
        }
        let finished = await_reply(py, reply, &self.interrupt)?.map_err(raised)?;
        let summary = to_python(py, &finished.summary);
        *self.state.lock().map_err(|_| broken())? = State::Finished(Box::new(finished));
        summary
    }

    fn __enter__(this: Bound<'_, Self>) -> Bound<'_, Self> {
        this
    }

    /// Finishes what is not finished; after an exception the run is given up.
    fn __exit__(
        &self,
        py: Python<'_>,
        kind: Option<Bound<'_, PyAny>>,
        _value: Option<Bound<'_, PyAny>>,
        _traceback: Option<Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        if kind.is_some() {
            *self.state.lock().map_err(|_| broken())? = State::Broken;
            return Ok(());
        }
        self.finish(py).map(drop)
    }
}

/// Moves for a while, as the skills do: within the pace that keeps the arm slow beside things.
fn tick(
    agent: &mut Agent,
    base: Twist,
    arm: &JointVelocities,
    gripper: Option<(f64, f64)>,
    duration: Span,
) -> Result<(), Halt> {
    if let Some((width_m, force_n)) = gripper {
        agent.grip(width_m, force_n);
    }
    let end = agent.now() + duration;
    while agent.now() < end {
        agent.tick(base, arm)?;
    }
    Ok(())
}
