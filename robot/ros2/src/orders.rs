//! Tasks that others order: the action `DoTask`.
//!
//! One task at a time: an order that comes while another is carried out waits for its turn. Cancelling asks the task to
//! stop; its result says what it came to.

use crate::error::Ros2Error;
use crate::link::{Link, LinkBuilder};
use crate::messages::{DoTaskFeedback, DoTaskGoal, DoTaskResult};
use futures::channel::{mpsc, oneshot};
use futures::{FutureExt, StreamExt, select};
use ros2_client::AsyncActionServer;
use ros2_client::action::{ExecutingGoalHandle, GoalEndStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

/// The action.
pub const DO_TASK: &str = "/dsm/do_task";

/// A task that was ordered.
pub struct Order {
    /// Plain English.
    pub command: String,
    /// Set when whoever ordered it wants it no more.
    pub cancelled: Arc<AtomicBool>,
    /// Takes what happens on the way, for whoever ordered it.
    pub events: Events,
    done: oneshot::Sender<DoTaskResult>,
}

/// Takes what happens on the way.
#[derive(Clone)]
pub struct Events(mpsc::UnboundedSender<DoTaskFeedback>);

impl Events {
    /// Tells whoever ordered the task.
    pub fn tell(&self, event: impl Into<String>) {
        // Whoever ordered it may be gone.
        let _ = self.0.unbounded_send(DoTaskFeedback { event: event.into() });
    }
}

impl Order {
    /// Says what became of it.
    pub fn finish(self, result: DoTaskResult) {
        // Whoever ordered it may be gone.
        let _ = self.done.send(result);
    }
}

/// Where tasks are ordered.
pub struct Desk {
    /// Ends with the desk.
    _link: Link<()>,
    /// The orders.
    pub orders: Receiver<Order>,
}

impl Desk {
    /// Joins the graph.
    ///
    /// # Errors
    /// [`Ros2Error`].
    pub fn open(domain: u16) -> Result<Self, Ros2Error> {
        let mut link = LinkBuilder::new("dsm_desk", domain)?;
        let (taken, orders) = channel();
        link.act(DO_TASK, "dsm_msgs", "DoTask", move |server| attend(server, taken))?;
        Ok(Self { _link: link.start()?, orders })
    }
}

type DoTaskServer = AsyncActionServer<DoTaskGoal, DoTaskResult, DoTaskFeedback>;

/// Takes one order after the other.
async fn attend(server: DoTaskServer, taken: Sender<Order>) {
    loop {
        let handle = match server.receive_new_goal().await {
            Ok(handle) => handle,
            Err(error) => {
                tracing::warn!("{DO_TASK}: an order that is none: {error:?}");
                continue;
            }
        };
        let Some(goal) = server.get_new_goal(handle.clone()) else { continue };
        let accepted = match server.accept_goal(handle).await {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!("{DO_TASK}: {error:?}");
                continue;
            }
        };
        let Ok(executing) = server.start_executing_goal(accepted).await else { continue };
        let ((events, mut told), (done, result)) = (mpsc::unbounded(), oneshot::channel());
        let cancelled = Arc::new(AtomicBool::new(false));
        let order = Order { command: goal.command, cancelled: cancelled.clone(), events: Events(events), done };
        if taken.send(order).is_err() {
            return;
        }
        let result = follow(&server, &executing, &mut told, result, &cancelled).await;
        let status = match (&result, cancelled.load(Ordering::Relaxed)) {
            (result, _) if result.success => GoalEndStatus::Succeeded,
            (_, true) => GoalEndStatus::Canceled,
            (_, false) => GoalEndStatus::Aborted,
        };
        if let Err(error) = server.send_result_response(executing, status, result).await {
            tracing::warn!("{DO_TASK}: {error:?}");
        }
    }
}

/// Passes on what happens until the task is over, and hears who wants it no more.
async fn follow(
    server: &DoTaskServer,
    executing: &ExecutingGoalHandle<DoTaskGoal>,
    told: &mut mpsc::UnboundedReceiver<DoTaskFeedback>,
    result: oneshot::Receiver<DoTaskResult>,
    cancelled: &AtomicBool,
) -> DoTaskResult {
    let mut result = result.fuse();
    loop {
        select! {
            done = result => {
                let lost = DoTaskResult { outcome: "failed".into(), reason: "the task is gone".into(), success: false };
                return done.unwrap_or(lost);
            }
            event = told.next() => {
                if let Some(event) = event
                    && let Err(error) = server.publish_feedback(executing.clone(), event).await
                {
                    tracing::debug!("{DO_TASK}: {error:?}");
                }
            }
            asked = server.receive_cancel_request().fuse() => {
                let Ok(asked) = asked else { continue };
                let goal = executing.goal_id();
                if asked.contains_goal(&goal) {
                    cancelled.store(true, Ordering::Relaxed);
                }
                let ours = asked.goals().filter(|asked| *asked == goal).collect::<Vec<_>>();
                if let Err(error) = server.respond_to_cancel_requests(&asked, ours.into_iter()).await {
                    tracing::debug!("{DO_TASK}: {error:?}");
                }
            }
        }
    }
}
