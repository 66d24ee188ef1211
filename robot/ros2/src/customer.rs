//! The other end of the map's service and of the desk: who asks and orders.

use crate::error::Ros2Error;
use crate::link::{Delivery, Link, LinkBuilder};
use crate::map_out::GROUND_TEXT;
use crate::messages::{DoTaskFeedback, DoTaskGoal, DoTaskResult, GroundTextRequest, GroundTextResponse};
use crate::orders::DO_TASK;
use futures::executor::block_on;
use futures::future::{Either, select};
use ros2_client::{ActionClient, Client, Name, ServiceMapping, ServiceTypeName};
use std::time::Duration;

/// Asks a map and orders tasks.
pub struct Customer {
    link: Link<()>,
    ground: Client<GroundTextRequest, GroundTextResponse>,
    tasks: ActionClient<DoTaskGoal, DoTaskResult, DoTaskFeedback>,
    timeout: Duration,
}

impl Customer {
    /// Joins the graph; who answers is waited for as long as `timeout`.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn new(domain: u16, timeout: Duration) -> Result<Self, Ros2Error> {
        let mut link = LinkBuilder::new("dsm_customer", domain)?;
        let failed = |what: &str, reason: String| Ros2Error::Setup { what: what.into(), reason };
        let qos = Delivery::Reliable { depth: 8 }.profile();
        let name = |name: &str| Name::parse(name).map_err(|error| failed(name, format!("{error:?}")));
        let kind = ServiceTypeName::new("dsm_msgs", "GroundText");
        let mapping = ServiceMapping::Enhanced;
        let ground = link.node_mut().create_client(mapping, &name(GROUND_TEXT)?, &kind, qos.clone(), qos);
        let ground = ground.map_err(|error| failed(GROUND_TEXT, format!("{error:?}")))?;
        let tasks = link.request(DO_TASK, "dsm_msgs", "DoTask")?;
        Ok(Self { link: link.start()?, ground, tasks, timeout })
    }

    fn silent(&self, what: &str) -> Ros2Error {
        let (timeout_s, domain) = (self.timeout.as_secs_f64(), self.link.domain());
        Ros2Error::Silent { topics: vec![what.to_owned()], timeout_s, domain }
    }

    /// What a text means.
    ///
    /// # Errors
    /// [`Ros2Error::Silent`]: nobody answers.
    pub fn ground(&self, text: &str) -> Result<GroundTextResponse, Ros2Error> {
        let asked = async {
            self.ground.wait_for_service(self.link.node()).await;
            self.ground.async_call_service(GroundTextRequest { text: text.into() }).await.ok()
        };
        self.within(self.timeout, asked).flatten().ok_or_else(|| self.silent(GROUND_TEXT))
    }

    /// Orders a task and waits for what becomes of it, for at most `patience`. What happened on the way, and the result.
    ///
    /// # Errors
    /// [`Ros2Error::Silent`]: nobody takes the order, or it is not over in time.
    pub fn order(&self, command: &str, patience: Duration) -> Result<(Vec<String>, DoTaskResult), Ros2Error> {
        let ordered = async {
            self.tasks.goal_client().wait_for_service(self.link.node()).await;
            self.tasks.async_send_goal(DoTaskGoal { command: command.into() }).await.ok()
        };
        let (goal, answer) = self.within(self.timeout, ordered).flatten().ok_or_else(|| self.silent(DO_TASK))?;
        if !answer.accepted {
            return Err(self.silent(DO_TASK));
        }
        let result = self.within(patience, self.tasks.async_request_result(goal));
        let (_, result) = result.and_then(Result::ok).ok_or_else(|| self.silent(DO_TASK))?;
        let told = std::iter::from_fn(|| self.tasks.receive_feedback(goal).ok().flatten());
        Ok((told.map(|told| told.event).collect(), result))
    }

    /// What comes of `work` within a time.
    fn within<T>(&self, time: Duration, work: impl Future<Output = T>) -> Option<T> {
        let (late, is_late) = futures::channel::oneshot::channel::<()>();
        let (over, is_over) = std::sync::mpsc::channel::<()>();
        let timer = std::thread::spawn(move || {
            // Ends early when the work is over.
            if is_over.recv_timeout(time).is_err_and(|error| error == std::sync::mpsc::RecvTimeoutError::Timeout) {
                let _ = late.send(());
            }
        });
        let result = match block_on(select(Box::pin(work), is_late)) {
            Either::Left((result, _)) => Some(result),
            Either::Right(_) => None,
        };
        drop(over);
        timer.join().ok()?;
        result
    }
}
