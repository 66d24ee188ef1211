//! What a detector looks for: fixed names, and those that a language model gives to what frames show (use `tags`).
//!
//! The model is asked beside the detector and never waited for: its names are looked for from the next frame on. What the
//! cache answers is there at once, so that a run whose answers are all cached does not depend on the speed of threads.

use crate::client::Client;
use crate::error::ModelError;
use crate::networks::DetectorSettings;
use crate::picture::Canvas;
use crate::settings::{Answers, Use};
use crate::tags::list_tags_from;
use dsm::frame::RgbdFrame;
use dsm::knowledge::Knowledge;
use dsm::time::{Span, Stamp};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Longer side of the picture of which a model tells the tags, pixels.
const PICTURE_PX: u32 = 640;

/// Names to look for.
pub(super) struct Prompts {
    fixed: Vec<String>,
    /// The latest at the back.
    tags: VecDeque<String>,
    most_tags: usize,
    every: Span,
    next: Option<Stamp>,
    asked: Option<Asked>,
}

/// A language model that is asked beside the detector, one picture at a time.
struct Asked {
    client: Arc<Client>,
    knowledge: Arc<Knowledge>,
    pictures: Sender<Canvas>,
    answers: Receiver<Vec<String>>,
    /// Whether an answer is to come.
    is_open: bool,
}

impl Prompts {
    /// The names of the settings, or of the knowledge table; with those of a model that is asked for tags.
    pub(super) fn new(settings: &DetectorSettings, client: Option<Arc<Client>>, knowledge: &Arc<Knowledge>) -> Self {
        let named = || knowledge.categories().iter().map(|category| category.name.clone()).collect();
        let given = &settings.vocabulary;
        let mut fixed: Vec<String> = if given.is_empty() { named() } else { given.clone() };
        fixed.sort_unstable();
        fixed.dedup();
        let client = client.filter(|client| client.settings().serves(Use::Tags) && settings.most_tags > 0);
        Self {
            fixed,
            tags: VecDeque::new(),
            most_tags: settings.most_tags as usize,
            every: Span::from_s(settings.tags_every_s),
            next: None,
            asked: client.map(|client| Asked::new(client, knowledge.clone())),
        }
    }

    /// What is looked for in a frame.
    pub(super) fn names(&mut self, frame: &RgbdFrame) -> Vec<String> {
        let mut heard = self.asked.as_mut().map(Asked::hear).unwrap_or_default();
        if self.next.is_none_or(|next| frame.stamp >= next)
            && let Some(asked) = self.asked.as_mut().filter(|asked| !asked.is_open)
        {
            self.next = Some(frame.stamp + self.every);
            heard.extend(asked.ask(Canvas::of_frame(frame, PICTURE_PX)));
        }
        for name in heard {
            if self.fixed.binary_search(&name).is_ok() {
                continue;
            }
            self.tags.retain(|known| *known != name);
            self.tags.push_back(name);
        }
        while self.tags.len() > self.most_tags {
            self.tags.pop_front();
        }
        self.fixed.iter().chain(&self.tags).cloned().collect()
    }
}

impl Asked {
    fn new(client: Arc<Client>, knowledge: Arc<Knowledge>) -> Self {
        let (pictures, inbox) = channel::<Canvas>();
        let (outbox, answers) = channel();
        let (model, table) = (client.clone(), knowledge.clone());
        // It ends with its last picture: nobody waits for it.
        std::thread::spawn(move || {
            for canvas in inbox {
                let tags = list_tags_from(&model, Answers::Live, &table, &canvas).unwrap_or_default();
                if outbox.send(tags).is_err() {
                    return;
                }
            }
        });
        Self { client, knowledge, pictures, answers, is_open: false }
    }

    /// Names that came since the last time.
    fn hear(&mut self) -> Vec<String> {
        let Ok(names) = self.answers.try_recv() else { return Vec::new() };
        self.is_open = false;
        names
    }

    /// Asks about a picture; gives the names if the cache has them.
    fn ask(&mut self, canvas: Canvas) -> Vec<String> {
        match list_tags_from(&self.client, Answers::Cached, &self.knowledge, &canvas) {
            Ok(names) => names,
            Err(ModelError::NotCached) if self.client.settings().answers == Answers::Live => {
                self.is_open = self.pictures.send(canvas).is_ok();
                Vec::new()
            }
            Err(_) => Vec::new(),
        }
    }
}
