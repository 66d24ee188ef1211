//! What a task tells beside its commands: its log while it runs, and an account at the end.

use crate::error::Ros2Error;
use crate::link::{Delivery, Link, LinkBuilder, Speaker};
use crate::messages::{Account, Bool};
use crate::wall::instant;
use std::time::Duration;

/// The log of all nodes.
pub(crate) const LOG_TOPIC: &str = "/rosout";
/// Our lines in it.
pub(crate) const OWN_NAME: &str = "dsm";
/// Takes the account.
pub(crate) const ACCOUNT_TOPIC: &str = "/dsm/account";
/// Says that the account was taken.
pub(crate) const TAKEN_TOPIC: &str = "/dsm/taken";
/// How often is looked whether anybody is there.
const LOOK: Duration = Duration::from_millis(20);

/// Hands an account to whoever judges.
pub struct Teller {
    link: Link<Bool>,
    speaker: Speaker<Account>,
}

impl Teller {
    /// Joins the graph.
    ///
    /// # Errors
    /// [`Ros2Error`].
    pub fn start(domain: u16) -> Result<Self, Ros2Error> {
        let mut link = LinkBuilder::new("dsm_task", domain)?;
        let one = Delivery::Reliable { depth: 1 };
        link.listen(TAKEN_TOPIC, one, |taken: Bool| taken)?;
        let speaker = link.speak(ACCOUNT_TOPIC, one)?;
        Ok(Self { link: link.start()?, speaker })
    }

    /// Tells the account, and waits until it is taken, for at most `timeout_s`. Whether it was: a robot that nobody judges
    /// takes none.
    pub fn tell(mut self, account: Account, timeout_s: f64) -> bool {
        let timeout = Duration::from_secs_f64(timeout_s);
        let start = instant();
        if self.speaker.say(account).is_err() {
            return false;
        }
        while start.elapsed() < timeout {
            if self.link.wait(LOOK).is_some() {
                return true;
            }
            if !self.link.find_lonely().is_empty() {
                return false;
            }
        }
        false
    }
}
