//! A place in the ROS 2 graph: speakers that publish, listeners whose messages come in at one inbox, in one order.
//!
//! Two threads belong to a link: one for discovery, one that takes messages from all listeners. Both end with it.

use crate::error::Ros2Error;
use crate::messages::RosMessage;
use futures::channel::oneshot;
use futures::future::{Either, LocalBoxFuture, join_all, select};
use futures::{FutureExt, StreamExt};
use ros2_client::action::{ActionClientQosPolicies, ActionServerQosPolicies};
use ros2_client::dds::rustdds::Topic;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    ActionClient, ActionServer, ActionTypeName, AsyncActionServer, Context, ContextOptions, Message, MessageTypeName,
    Name, Node, NodeName, NodeOptions, Publisher, QosProfile, ServiceMapping, ServiceTypeName,
};
use std::future::Future;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// How messages of a topic travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// What is lost is sent again; the newest `depth` are kept for it.
    Reliable {
        /// How many.
        depth: usize,
    },
    /// What is lost is lost: pictures over radio.
    BestEffort {
        /// How many may wait to be read.
        depth: usize,
    },
    /// Reliable, and who comes late gets the last one.
    Kept,
}

impl Delivery {
    pub(crate) fn profile(self) -> QosProfile {
        let profile = QosProfile::publisher_default().durability(Durability::Volatile);
        match self {
            Self::Reliable { depth } => {
                profile.history(History::KeepLast { depth }).reliability_reliable(WhenFull::DEFAULT)
            }
            Self::BestEffort { depth } => profile.history(History::KeepLast { depth }).reliability_best_effort(),
            Self::Kept => profile
                .history(History::KeepLast { depth: 1 })
                .reliability_reliable(WhenFull::DEFAULT)
                .durability(Durability::TransientLocal),
        }
    }
}

/// Takes the messages of one listener until the link ends.
type Reader = Box<dyn FnOnce() -> LocalBoxFuture<'static, ()> + Send>;

/// A link that is being built. `I` is what its listeners make of their messages.
pub struct LinkBuilder<I> {
    node: Node,
    domain: u16,
    outbox: Sender<(usize, I)>,
    inbox: Receiver<(usize, I)>,
    readers: Vec<Reader>,
    heard: Vec<String>,
    heard_aside: Vec<String>,
    spoken: Vec<String>,
}

impl<I: Send + 'static> LinkBuilder<I> {
    /// A node of this name in a DDS domain (0 to 232).
    ///
    /// # Errors
    /// [`Ros2Error::Setup`]: the name is none, or DDS has no network.
    pub fn new(name: &str, domain: u16) -> Result<Self, Ros2Error> {
        let failed = |reason: String| Ros2Error::Setup { what: format!("node `{name}`, domain {domain}"), reason };
        let context = Context::with_options(ContextOptions::new().domain_id(domain));
        let context = context.map_err(|error| failed(format!("{error:?}")))?;
        let name = NodeName::new("/", name).map_err(|error| failed(format!("{error:?}")))?;
        let node = context.new_node(name, NodeOptions::new()).map_err(|error| failed(format!("{error:?}")))?;
        let (outbox, inbox) = channel();
        Ok(Self {
            node,
            domain,
            outbox,
            inbox,
            readers: Vec::new(),
            heard: Vec::new(),
            heard_aside: Vec::new(),
            spoken: Vec::new(),
        })
    }

    fn topic<M: RosMessage>(&mut self, name: &str, delivery: Delivery) -> Result<Topic, Ros2Error> {
        let failed = |reason: String| Ros2Error::Setup { what: format!("topic `{name}`"), reason };
        let parsed = Name::parse(name).map_err(|error| failed(format!("{error:?}")))?;
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        self.node.create_topic(&parsed, kind, &delivery.profile()).map_err(|error| failed(format!("{error:?}")))
    }

    /// Listens on a topic.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn listen<M: RosMessage>(
        &mut self,
        name: &str,
        delivery: Delivery,
        take: impl Fn(M) -> I + Send + 'static,
    ) -> Result<(), Ros2Error> {
        let topic = self.topic::<M>(name, delivery)?;
        let subscription = self.node.create_subscription::<M>(&topic, None);
        let subscription = subscription
            .map_err(|error| Ros2Error::Setup { what: format!("topic `{name}`"), reason: format!("{error:?}") })?;
        let (outbox, spoken_of, listener) = (self.outbox.clone(), name.to_owned(), self.heard.len());
        self.readers.push(Box::new(move || {
            async move {
                let mut messages = Box::pin(subscription.async_stream());
                while let Some(message) = messages.next().await {
                    match message {
                        Ok((message, _)) => {
                            if outbox.send((listener, take(message))).is_err() {
                                return;
                            }
                        }
                        Err(error) => tracing::warn!("{spoken_of}: a message that is none: {error:?}"),
                    }
                }
            }
            .boxed_local()
        }));
        self.heard.push(name.to_owned());
        Ok(())
    }

    /// Publishes on a topic.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn speak<M: RosMessage>(&mut self, name: &str, delivery: Delivery) -> Result<Speaker<M>, Ros2Error> {
        let speaker = self.speak_aside(name, delivery)?;
        self.spoken.push(name.to_owned());
        Ok(speaker)
    }

    /// Publishes on a topic that nobody need hear.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn speak_aside<M: RosMessage>(&mut self, name: &str, delivery: Delivery) -> Result<Speaker<M>, Ros2Error> {
        let topic = self.topic::<M>(name, delivery)?;
        let publisher = self.node.create_publisher::<M>(&topic, None);
        let publisher = publisher
            .map_err(|error| Ros2Error::Setup { what: format!("topic `{name}`"), reason: format!("{error:?}") })?;
        Ok(Speaker { topic: name.to_owned(), publisher, sent: 0 })
    }

    /// Answers a service; `answer` is called for one request after the other.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn answer<Q: Message + Clone + Send + 'static, A: Message + Clone + Send + 'static>(
        &mut self,
        name: &str,
        package: &str,
        kind: &str,
        mut answer: impl FnMut(Q) -> A + Send + 'static,
    ) -> Result<(), Ros2Error> {
        let failed = |reason: String| Ros2Error::Setup { what: format!("service `{name}`"), reason };
        let parsed = Name::parse(name).map_err(|error| failed(format!("{error:?}")))?;
        let (kind, qos) = (ServiceTypeName::new(package, kind), Delivery::Reliable { depth: 8 }.profile());
        let server = self.node.create_server::<Q, A>(ServiceMapping::Enhanced, &parsed, &kind, qos.clone(), qos);
        let server = server.map_err(|error| failed(format!("{error:?}")))?;
        let name = name.to_owned();
        self.readers.push(Box::new(move || {
            async move {
                loop {
                    match server.async_receive_request().await {
                        Ok((id, asked)) => {
                            if let Err(error) = server.async_send_response(id, answer(asked)).await {
                                tracing::warn!("{name}: {}", shortened(&format!("{error:?}")));
                            }
                        }
                        Err(error) => tracing::warn!("{name}: a request that is none: {error:?}"),
                    }
                }
            }
            .boxed_local()
        }));
        Ok(())
    }

    /// Offers an action whose requests are looked for by whoever offers it.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn offer<G, R, F>(&mut self, name: &str, package: &str, kind: &str) -> Result<ActionServer<G, R, F>, Ros2Error>
    where
        G: Message + Clone + 'static,
        R: Message + Clone + 'static,
        F: Message + 'static,
    {
        let failed = |reason: String| Ros2Error::Setup { what: format!("action `{name}`"), reason };
        let parsed = Name::parse(name).map_err(|error| failed(format!("{error:?}")))?;
        let service = Delivery::Reliable { depth: 8 }.profile();
        let policies = ActionServerQosPolicies {
            goal_service: service.clone(),
            result_service: service.clone(),
            cancel_service: service.clone(),
            feedback_publisher: service,
            status_publisher: Delivery::Kept.profile(),
        };
        let kind = ActionTypeName::new(package, kind);
        let server = self.node.create_action_server::<G, R, F>(ServiceMapping::Enhanced, &parsed, &kind, policies);
        server.map_err(|error| failed(format!("{error:?}")))
    }

    /// Asks for an action.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn request<G, R, F>(
        &mut self,
        name: &str,
        package: &str,
        kind: &str,
    ) -> Result<ActionClient<G, R, F>, Ros2Error>
    where
        G: Message + Clone + 'static,
        R: Message + Clone + 'static,
        F: Message + 'static,
    {
        let failed = |reason: String| Ros2Error::Setup { what: format!("action `{name}`"), reason };
        let parsed = Name::parse(name).map_err(|error| failed(format!("{error:?}")))?;
        let service = Delivery::Reliable { depth: 8 }.profile();
        let policies = ActionClientQosPolicies {
            goal_service: service.clone(),
            result_service: service.clone(),
            cancel_service: service.clone(),
            feedback_subscription: service,
            status_subscription: Delivery::Kept.profile(),
        };
        let kind = ActionTypeName::new(package, kind);
        // Who offers an action says how its goals are.
        self.heard_aside.push(format!("{name}/_action/status"));
        let client = self.node.create_action_client::<G, R, F>(ServiceMapping::Enhanced, &parsed, &kind, policies);
        client.map_err(|error| failed(format!("{error:?}")))
    }

    /// Offers an action; `work` drives it for as long as the link lasts.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn act<G, R, F, W>(
        &mut self,
        name: &str,
        package: &str,
        kind: &str,
        work: impl FnOnce(AsyncActionServer<G, R, F>) -> W + Send + 'static,
    ) -> Result<(), Ros2Error>
    where
        G: Message + Clone + Send + 'static,
        R: Message + Clone + Send + 'static,
        F: Message + Send + 'static,
        W: Future<Output = ()> + 'static,
    {
        let server = AsyncActionServer::new(self.offer(name, package, kind)?);
        self.readers.push(Box::new(move || work(server).boxed_local()));
        Ok(())
    }

    pub(crate) fn node_mut(&mut self) -> &mut Node {
        &mut self.node
    }

    /// Starts discovery and reading.
    ///
    /// # Errors
    /// [`Ros2Error::Setup`].
    pub fn start(mut self) -> Result<Link<I>, Ros2Error> {
        let spinner = self
            .node
            .spinner()
            .map_err(|error| Ros2Error::Setup { what: "discovery".into(), reason: format!("{error:?}") })?;
        let spin = std::thread::spawn(move || {
            if let Err(error) = futures::executor::block_on(spinner.spin()) {
                tracing::warn!("ROS 2 discovery ended: {error:?}");
            }
        });
        let (stop, stopped) = oneshot::channel::<()>();
        let readers = self.readers;
        let read = std::thread::spawn(move || {
            let reading = join_all(readers.into_iter().map(|reader| reader()));
            match futures::executor::block_on(select(reading, stopped)) {
                Either::Left(_) | Either::Right(_) => {}
            }
        });
        Ok(Link {
            node: self.node,
            domain: self.domain,
            inbox: self.inbox,
            _open: self.outbox,
            taken: vec![0; self.heard.len()],
            heard: self.heard,
            heard_aside: self.heard_aside,
            spoken: self.spoken,
            stop: Some(stop),
            threads: vec![read, spin],
        })
    }
}

/// Publishes on one topic.
pub struct Speaker<M: RosMessage> {
    topic: String,
    publisher: Publisher<M>,
    sent: u64,
}

impl<M: RosMessage> Speaker<M> {
    /// Publishes a message; `Err` with why when it cannot.
    pub fn say(&mut self, message: M) -> Result<(), String> {
        let said = self.publisher.publish(message);
        said.map_err(|error| format!("{}: {}", self.topic, shortened(&format!("{error}"))))?;
        self.sent += 1;
        Ok(())
    }

    /// Its topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// How many messages were published since it began to count.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Begins to count anew.
    pub fn forget_sent(&mut self) {
        self.sent = 0;
    }
}

/// An error may quote the whole message, which may be a picture.
fn shortened(text: &str) -> String {
    text.chars().take(200).collect()
}

/// A place in the graph.
pub struct Link<I> {
    node: Node,
    domain: u16,
    inbox: Receiver<(usize, I)>,
    /// Keeps the inbox open: without a listener waiting must last as well.
    _open: Sender<(usize, I)>,
    heard: Vec<String>,
    /// Topics that somebody must publish, though they are not taken in here.
    heard_aside: Vec<String>,
    /// Messages taken in, by listener.
    taken: Vec<u64>,
    spoken: Vec<String>,
    stop: Option<oneshot::Sender<()>>,
    threads: Vec<JoinHandle<()>>,
}

impl<I> Link<I> {
    /// The next message that is there.
    pub fn find(&mut self) -> Option<I> {
        let taken = self.inbox.try_recv().ok();
        self.count(taken)
    }

    /// The next message, waited for as long as `timeout`.
    pub fn wait(&mut self, timeout: Duration) -> Option<I> {
        let taken = self.inbox.recv_timeout(timeout).ok();
        self.count(taken)
    }

    fn count(&mut self, taken: Option<(usize, I)>) -> Option<I> {
        let (listener, message) = taken?;
        self.taken[listener] += 1;
        Some(message)
    }

    /// How many messages of a topic were taken in; `None` when nobody listens on it here.
    pub fn find_taken(&self, topic: &str) -> Option<u64> {
        self.heard.iter().position(|heard| heard == topic).map(|listener| self.taken[listener])
    }

    /// Begins to count anew.
    pub fn forget_taken(&mut self) {
        self.taken.fill(0);
    }

    /// The topics that nobody else has joined yet: nobody publishes what is heard, nobody hears what is published.
    pub fn find_lonely(&self) -> Vec<String> {
        let unheard = self.spoken.iter().filter(|topic| self.node.subscription_count(topic) == 0);
        let unspoken = self.heard.iter().chain(&self.heard_aside).filter(|topic| self.node.publisher_count(topic) == 0);
        unheard.chain(unspoken).cloned().collect()
    }

    /// Whether anybody hears what a speaker says.
    pub fn is_heard<M: RosMessage>(&self, speaker: &Speaker<M>) -> bool {
        self.node.subscription_count(&speaker.topic) > 0
    }

    pub(crate) fn node(&self) -> &Node {
        &self.node
    }

    /// The DDS domain.
    pub fn domain(&self) -> u16 {
        self.domain
    }
}

impl<I> Drop for Link<I> {
    fn drop(&mut self) {
        self.node.stop_spinner();
        if let Some(stop) = self.stop.take() {
            // A reader that has ended needs no word.
            let _ = stop.send(());
        }
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                tracing::warn!("a thread of the ROS 2 link panicked");
            }
        }
    }
}
