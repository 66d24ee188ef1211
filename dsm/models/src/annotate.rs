//! Frames described beside the map's construction: a model takes seconds, and nothing waits for it.
//!
//! ```text
//! frame, sightings ──choose few──▶ marked picture ──▶ workers ──ask──▶ names, attributes, relations ──at stamp + latency──▶ map
//! ```
//!
//! What the cache answers is answered at once, so that a run whose answers are all cached does not depend on the speed of
//! threads. An answer shows at its frame's stamp plus the declared latency, or later when the model is slower; answers
//! keep the order of their frames.

use crate::attributes::{Marked, Vocabulary, describe};
use crate::client::Client;
use crate::error::ModelError;
use crate::marks::draw_mark;
use crate::picture::{Canvas, Picture};
use crate::relations::relate;
use crate::settings::{Answers, FrameSettings, Use};
use dsm::frame::{FrameId, RgbdFrame};
use dsm::knowledge::Knowledge;
use dsm::map::ObjectId;
use dsm::perceive::{Annotation, Annotator, AttributeVote, Remark, RemarkedRelation, Sighting};
use dsm::time::{Span, Stamp};
use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Objects whose number of questions is remembered.
const MOST_REMEMBERED: usize = 100_000;

/// Describes frames by a vision-language model.
pub struct LanguageAnnotator {
    mind: Arc<Mind>,
    jobs: Option<Sender<(u64, Task)>>,
    results: Receiver<(u64, Option<Annotation>)>,
    workers: Vec<JoinHandle<()>>,
    under_way: VecDeque<Pending>,
    asked: BTreeMap<ObjectId, u32>,
    frames: u32,
    next_stamp: Option<Stamp>,
    next_number: u64,
}

/// An answer that is to come, or that waits for its moment.
struct Pending {
    number: u64,
    ready: Stamp,
    answer: Option<Option<Annotation>>,
}

/// What a worker needs to know of a frame.
struct Task {
    frame: FrameId,
    stamp: Stamp,
    picture: Picture,
    marks: Vec<Marked>,
    /// The object of each mark.
    objects: BTreeMap<u32, ObjectId>,
}

/// What all workers share.
struct Mind {
    client: Arc<Client>,
    knowledge: Arc<Knowledge>,
    vocabulary: Vocabulary,
}

impl LanguageAnnotator {
    /// An annotator that asks `client` from as many threads as requests may be under way.
    pub fn new(client: Arc<Client>, knowledge: Arc<Knowledge>) -> Self {
        let workers = client.settings().max_concurrent.min(client.settings().frames.most_pending);
        let vocabulary = Vocabulary::new(&knowledge);
        let mind = Arc::new(Mind { client, knowledge, vocabulary });
        let (jobs, inbox) = channel();
        let (outbox, results) = channel();
        let inbox = Arc::new(Mutex::new(inbox));
        let start = |_| {
            let (mind, inbox, outbox) = (mind.clone(), inbox.clone(), outbox.clone());
            std::thread::spawn(move || work(&mind, &inbox, &outbox))
        };
        Self {
            workers: (0..workers).map(start).collect(),
            mind,
            jobs: Some(jobs),
            results,
            under_way: VecDeque::new(),
            asked: BTreeMap::new(),
            frames: 0,
            next_stamp: None,
            next_number: 0,
        }
    }

    fn settings(&self) -> &FrameSettings {
        &self.mind.client.settings().frames
    }

    /// Whether this frame may be asked about.
    fn is_due(&self, stamp: Stamp) -> bool {
        let settings = self.settings();
        self.next_stamp.is_none_or(|next| stamp >= next)
            && self.frames < settings.most_frames
            && self.under_way.iter().filter(|pending| pending.answer.is_none()).count() < settings.most_pending as usize
            && self.mind.client.settings().serves(Use::Attributes)
    }

    /// The things that are asked about: those asked about least so far, the largest first.
    fn choose<'s, 'a>(&self, seen: &'s [Sighting<'a>]) -> Vec<&'s Sighting<'a>> {
        let settings = self.settings();
        let times = |sighting: &Sighting<'_>| self.asked.get(&sighting.object).copied().unwrap_or(0);
        let area = |sighting: &Sighting<'_>| sighting.mask.area();
        let mut chosen: Vec<&Sighting<'_>> = seen
            .iter()
            .filter(|sighting| times(sighting) < settings.views_per_object)
            .filter(|sighting| area(sighting) >= settings.min_pixels as usize)
            .collect();
        chosen.sort_by_key(|s| (s.object, std::cmp::Reverse(area(s))));
        chosen.dedup_by_key(|s| s.object);
        chosen.sort_by_key(|s| (times(s), std::cmp::Reverse(area(s)), s.object));
        chosen.truncate(settings.objects_per_call as usize);
        chosen
    }

    fn task_of(&self, frame: &RgbdFrame, chosen: &[&Sighting<'_>]) -> Option<Task> {
        let mut canvas = Canvas::of_frame(frame, self.settings().picture_px);
        let numbered = || (1_u32..).zip(chosen);
        numbered().for_each(|(mark, sighting)| draw_mark(&mut canvas, sighting.mask, mark));
        let marked = |(mark, sighting): (u32, &&Sighting<'_>)| Marked { mark, name: sighting.name.to_owned() };
        Some(Task {
            frame: frame.id,
            stamp: frame.stamp,
            picture: canvas.encode()?,
            marks: numbered().map(marked).collect(),
            objects: numbered().map(|(mark, sighting)| (mark, sighting.object)).collect(),
        })
    }

    /// Takes in what the workers have done.
    fn collect(&mut self) {
        while let Ok((number, answer)) = self.results.try_recv() {
            self.put(number, answer);
        }
    }

    fn put(&mut self, number: u64, answer: Option<Annotation>) {
        if let Some(pending) = self.under_way.iter_mut().find(|pending| pending.number == number) {
            pending.answer = Some(answer);
        }
    }
}

impl Annotator for LanguageAnnotator {
    fn name(&self) -> &str {
        self.mind.client.name()
    }

    fn ask(&mut self, frame: &RgbdFrame, seen: &[Sighting<'_>]) {
        self.collect();
        if !self.is_due(frame.stamp) {
            return;
        }
        let chosen = self.choose(seen);
        if chosen.is_empty() {
            return;
        }
        let Some(task) = self.task_of(frame, &chosen) else { return };
        for sighting in chosen {
            *self.asked.entry(sighting.object).or_default() += 1;
        }
        while self.asked.len() > MOST_REMEMBERED {
            self.asked.pop_first();
        }
        self.frames += 1;
        self.next_stamp = Some(frame.stamp + Span::from_s(self.settings().every_s));
        let ready = frame.stamp + Span::from_s(self.settings().latency_s);
        let number = self.next_number;
        self.next_number += 1;
        let answer = match self.mind.annotate(Answers::Cached, &task) {
            Err(ModelError::NotCached) => None,
            cached => Some(cached.ok()),
        };
        let is_open = answer.is_none();
        self.under_way.push_back(Pending { number, ready, answer });
        let live = self.mind.client.settings().answers == Answers::Live;
        let sent = is_open && live && self.jobs.as_ref().is_some_and(|jobs| jobs.send((number, task)).is_ok());
        if is_open && !sent {
            self.put(number, None);
        }
    }

    fn find_answers(&mut self, now: Stamp) -> Vec<Annotation> {
        self.collect();
        let mut found = Vec::new();
        while self.under_way.front().is_some_and(|pending| pending.ready <= now && pending.answer.is_some()) {
            found.extend(self.under_way.pop_front().and_then(|pending| pending.answer).flatten());
        }
        found
    }

    fn finish(&mut self) -> Vec<Annotation> {
        drop(self.jobs.take());
        // Each worker ends when the jobs do; each job ends within the limits of its questions.
        while let Ok((number, answer)) = self.results.recv() {
            self.put(number, answer);
            if self.under_way.iter().all(|pending| pending.answer.is_some()) {
                break;
            }
        }
        self.under_way.drain(..).filter_map(|pending| pending.answer.flatten()).collect()
    }
}

impl Drop for LanguageAnnotator {
    fn drop(&mut self) {
        drop(self.jobs.take());
        // Workers are not waited for: they hold nothing but a question, and end with it.
        self.workers.clear();
    }
}

fn work(mind: &Mind, inbox: &Mutex<Receiver<(u64, Task)>>, outbox: &Sender<(u64, Option<Annotation>)>) {
    loop {
        let job = inbox.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((number, task)) = job else { return };
        if outbox.send((number, mind.annotate(Answers::Live, &task).ok())).is_err() {
            return;
        }
    }
}

impl Mind {
    /// Names, attributes and relations of one frame's marked things.
    fn annotate(&self, answers: Answers, task: &Task) -> Result<Annotation, ModelError> {
        let words = (&*self.knowledge, &self.vocabulary);
        let described = describe(&self.client, answers, words, &task.picture, &task.marks)?;
        let settings = &self.client.settings().frames;
        let remark = |one: crate::attributes::Described| {
            let weigh =
                |vote: AttributeVote| AttributeVote { weight: vote.weight * settings.attribute_weight as f32, ..vote };
            let name = one.name.filter(|_| settings.name_weight > 0.0);
            Some(Remark {
                object: *task.objects.get(&one.mark)?,
                name: name.map(|name| (name, settings.name_weight as f32)),
                attributes: one.attributes.into_iter().map(weigh).collect(),
            })
        };
        let wanted = task.marks.len() > 1 && self.client.settings().serves(Use::Relations);
        let related = match if wanted { relate(&self.client, answers, &task.picture, &task.marks) } else { Ok(vec![]) }
        {
            Ok(related) => related,
            Err(ModelError::NotCached) if answers == Answers::Cached => return Err(ModelError::NotCached),
            // What was said of the things themselves counts all the same.
            Err(_) => Vec::new(),
        };
        let relation = |related: crate::relations::Related| {
            let object = |mark| task.objects.get(&mark).copied();
            let (from, to) = (object(related.from)?, object(related.to)?);
            Some(RemarkedRelation { from, to, kind: related.kind, confidence: related.confidence })
        };
        Ok(Annotation {
            frame: task.frame,
            stamp: task.stamp,
            source: self.client.name().clone(),
            remarks: described.into_iter().filter_map(remark).collect(),
            relations: related.into_iter().filter_map(relation).collect(),
        })
    }
}
