//! Goals of actions: taken, carried out one at a time, answered when somebody asks.

use crate::error::Ros2Error;
use crate::link::LinkBuilder;
use ros2_client::action::{
    CancelGoalResponse, GetResultRequest, GetResultResponse, GoalId, GoalInfo, GoalStatusEnum, SendGoalResponse,
};
use ros2_client::action_msgs::CancelGoalResponseEnum;
use ros2_client::builtin_interfaces::Time;
use ros2_client::{ActionServer, Message, RmwRequestId};
use std::collections::VecDeque;

/// Results that are kept for those who have not asked yet.
const KEPT: usize = 64;

/// How a goal ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    Done,
    /// Not done, or something newer took its place.
    Aborted,
    Cancelled,
}

/// What somebody wants of an action.
pub(super) enum Wanted<G> {
    /// A goal; it takes the place of the one before.
    Goal(G),
    /// No goal any more.
    Cancel,
}

/// An action that is offered.
pub(super) struct Goals<G, R, F>
where
    G: Message + Clone,
    R: Message + Clone,
    F: Message,
{
    server: ActionServer<G, R, F>,
    running: Option<GoalId>,
    ended: VecDeque<(GoalId, GoalStatusEnum, R)>,
    asked: VecDeque<(RmwRequestId, GoalId)>,
}

fn bounded<T>(kept: &mut VecDeque<T>, item: T) {
    kept.push_back(item);
    while kept.len() > KEPT {
        kept.pop_front();
    }
}

impl<G, R, F> Goals<G, R, F>
where
    G: Message + Clone + 'static,
    R: Message + Clone + Default + 'static,
    F: Message + 'static,
{
    pub(super) fn offer<I: Send + 'static>(
        link: &mut LinkBuilder<I>,
        name: &str,
        package: &str,
        kind: &str,
    ) -> Result<Self, Ros2Error> {
        let server = link.offer(name, package, kind)?;
        Ok(Self { server, running: None, ended: VecDeque::new(), asked: VecDeque::new() })
    }

    /// What is wanted next, if anything. Every goal is taken: what cannot be done is said in its result.
    pub(super) fn find_wanted(&mut self) -> Option<Wanted<G>> {
        self.answer();
        if let Ok(Some((id, _))) = self.server.receive_cancel_request() {
            let goals_canceling: Vec<GoalInfo> =
                self.running.iter().map(|goal| GoalInfo { goal_id: *goal, stamp: Time::ZERO }).collect();
            let return_code = match self.running {
                Some(_) => CancelGoalResponseEnum::None,
                None => CancelGoalResponseEnum::UnknownGoal,
            };
            // Whoever asked may be gone.
            let _ = self.server.send_cancel_response(id, CancelGoalResponse { return_code, goals_canceling });
            return self.running.map(|_| Wanted::Cancel);
        }
        let (id, request) = self.server.receive_goal().ok().flatten()?;
        if self.server.send_goal_response(id, SendGoalResponse { accepted: true, stamp: Time::ZERO }).is_err() {
            return None;
        }
        if self.running.is_some() {
            self.end(Ended::Aborted, R::default());
        }
        self.running = Some(request.goal_id);
        Some(Wanted::Goal(request.goal))
    }

    /// Says how the goal that was carried out ended.
    pub(super) fn end(&mut self, ended: Ended, result: R) {
        let Some(goal) = self.running.take() else { return };
        let status = match ended {
            Ended::Done => GoalStatusEnum::Succeeded,
            Ended::Aborted => GoalStatusEnum::Aborted,
            Ended::Cancelled => GoalStatusEnum::Canceled,
        };
        bounded(&mut self.ended, (goal, status, result));
        self.answer();
    }

    /// Tells results to those who have asked for them.
    fn answer(&mut self) {
        while let Ok(Some((id, GetResultRequest { goal_id }))) = self.server.receive_result_request() {
            bounded(&mut self.asked, (id, goal_id));
        }
        let (server, ended) = (&self.server, &self.ended);
        self.asked.retain(|(id, goal)| {
            let Some((_, status, result)) = ended.iter().find(|(known, _, _)| known == goal) else { return true };
            // Whoever asked may be gone.
            let _ = server.send_result(*id, GetResultResponse { status: *status, result: result.clone() });
            false
        });
    }
}
