//! Contract: answers are asked for once and found again without a server; budgets, pauses and places hold; a server that is
//! away is left alone; and late answers show at their declared moment, the same for any number of threads.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its server fails")]

use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::knowledge::Knowledge;
use dsm::map::ObjectId;
use dsm::perceive::{Annotation, Annotator, Mask, Sighting};
use dsm::time::Stamp;
use dsm_models::wall::Wall;
use dsm_models::{
    Answers, Canvas, Client, Ending, LanguageAnnotator, LanguageSettings, ModelError, Reply, Transport, Use, list_tags,
};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex};

/// A clock on which pauses take no time.
#[derive(Clone, Default)]
struct Hand {
    now_s: Arc<Mutex<f64>>,
    pauses: Arc<Mutex<Vec<f64>>>,
}

impl Wall for Hand {
    fn now_s(&self) -> f64 {
        *self.now_s.lock().unwrap()
    }
    fn pause(&self, seconds: f64) {
        *self.now_s.lock().unwrap() += seconds;
        self.pauses.lock().unwrap().push(seconds);
    }
}

type Script = dyn Fn(&str) -> Result<Reply, ModelError> + Send + Sync;

/// A server that is a function; it counts requests and how many are under way.
#[derive(Clone)]
struct Fake {
    script: Arc<Script>,
    count: Arc<AtomicUsize>,
    busy: Arc<AtomicUsize>,
    most_busy: Arc<AtomicUsize>,
}

impl Fake {
    fn new(script: impl Fn(&str) -> Result<Reply, ModelError> + Send + Sync + 'static) -> Self {
        let zero = || Arc::new(AtomicUsize::new(0));
        Self { script: Arc::new(script), count: zero(), busy: zero(), most_busy: zero() }
    }
    fn count(&self) -> usize {
        self.count.load(Ordering::SeqCst)
    }
}

impl Transport for Fake {
    fn post(&self, body: &str, _: f64) -> Result<Reply, ModelError> {
        self.count.fetch_add(1, Ordering::SeqCst);
        let busy = 1 + self.busy.fetch_add(1, Ordering::SeqCst);
        self.most_busy.fetch_max(busy, Ordering::SeqCst);
        let reply = (self.script)(body);
        self.busy.fetch_sub(1, Ordering::SeqCst);
        reply
    }
}

fn status(status: u16, retry_after_s: Option<u64>) -> Result<Reply, ModelError> {
    Ok(Reply { status, retry_after_s, body: b"{}".to_vec() })
}

fn completion(answer: Value) -> Result<Reply, ModelError> {
    let body = json!({
        "choices": [{"message": {"content": json!({"thought": "", "answer": answer}).to_string()}}],
        "usage": {"prompt_tokens": 1000, "completion_tokens": 100},
    });
    Ok(Reply { status: 200, retry_after_s: None, body: body.to_string().into_bytes() })
}

fn settings() -> LanguageSettings {
    LanguageSettings { retries: 3, backoff_s: 1.0, ..LanguageSettings::new("http://127.0.0.1:1/v1", "fake") }
}

fn client(settings: LanguageSettings, fake: &Fake, hand: &Hand) -> Arc<Client> {
    let client = Client::with_transport(settings, None, Box::new(fake.clone()), Box::new(hand.clone()));
    Arc::new(client.unwrap())
}

fn knowledge() -> Arc<Knowledge> {
    Arc::new(Knowledge::embedded().unwrap())
}

/// A question; each shade asks another one.
fn tags(client: &Client, knowledge: &Knowledge, shade: u8) -> Result<Vec<String>, ModelError> {
    list_tags(client, knowledge, &Canvas { width: 4, height: 4, color: vec![[shade; 3]; 16], step: 1 })
}

fn cached(folder: &Path, answers: Answers) -> LanguageSettings {
    LanguageSettings { cache: Some(folder.to_owned()), answers, ..settings() }
}

#[test]
fn asked_again_an_answer_costs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (knowledge, hand) = (knowledge(), Hand::default());
    let good = Fake::new(|_| completion(json!({"things": ["mug"]})));
    let first = client(cached(folder.path(), Answers::Live), &good, &hand);
    assert_eq!(tags(&first, &knowledge, 1), Ok(vec!["mug".to_owned()]));
    assert_eq!(tags(&first, &knowledge, 1), Ok(vec!["mug".to_owned()]));
    assert_eq!(good.count(), 1);
    let endings: Vec<Ending> = first.events().iter().map(|event| event.ending).collect();
    assert_eq!(endings, [Ending::Answered, Ending::Cached]);
    assert_eq!((first.spent().cached, first.spent().input_tokens), (1, 1000));
    // Without a network: what is known is answered, the rest is not.
    let dead = Fake::new(|_| panic!("nothing may be sent"));
    let offline = client(cached(folder.path(), Answers::Cached), &dead, &hand);
    assert_eq!(tags(&offline, &knowledge, 1), Ok(vec!["mug".to_owned()]));
    assert_eq!(tags(&offline, &knowledge, 2), Err(ModelError::NotCached));
    // Another model, or other limits, are another question.
    let mut other = cached(folder.path(), Answers::Cached);
    other.max_tokens = 17;
    assert_eq!(tags(&client(other, &dead, &hand), &knowledge, 1), Err(ModelError::NotCached));
}

#[test]
fn a_repaired_answer_is_found_again_too() {
    let folder = tempfile::tempdir().unwrap();
    let (knowledge, hand) = (knowledge(), Hand::default());
    let fake = Fake::new(|body| match body.contains("cannot be used") {
        true => completion(json!({"things": ["mug"]})),
        false => completion(json!({"objects": []})),
    });
    let live = client(cached(folder.path(), Answers::Live), &fake, &hand);
    assert_eq!(tags(&live, &knowledge, 1), Ok(vec!["mug".to_owned()]));
    assert_eq!((fake.count(), live.events()[0].ending), (2, Ending::Repaired));
    let dead = Fake::new(|_| panic!("nothing may be sent"));
    assert!(tags(&client(cached(folder.path(), Answers::Cached), &dead, &hand), &knowledge, 1).is_ok());
}

#[test]
fn pauses_double_and_are_drawn_from_the_seed() {
    let knowledge = knowledge();
    let pauses = |seed: u64| {
        let (hand, fake) = (Hand::default(), Fake::new(|_| status(503, None)));
        let client = client(LanguageSettings { seed, ..settings() }, &fake, &hand);
        assert!(matches!(tags(&client, &knowledge, 1), Err(ModelError::Failing { status: 503, .. })));
        assert_eq!(fake.count(), 4);
        hand.pauses.lock().unwrap().clone()
    };
    let drawn = pauses(0);
    assert_eq!(drawn.len(), 3);
    for (pause, whole) in drawn.iter().zip([1.0, 2.0, 4.0]) {
        assert!((0.5 * whole..=whole).contains(pause), "{pause} of {whole}");
    }
    assert_eq!(drawn, pauses(0));
    assert_ne!(drawn, pauses(1));
}

#[test]
fn a_pause_is_as_long_as_asked_for_and_no_longer_than_allowed() {
    let (knowledge, hand) = (knowledge(), Hand::default());
    let fake = Fake::new(|_| status(429, Some(7)));
    let _ = tags(&client(settings(), &fake, &hand), &knowledge, 1);
    assert_eq!(*hand.pauses.lock().unwrap(), [7.0, 7.0, 7.0]);
    let fake = Fake::new(|_| status(429, Some(31)));
    let result = tags(&client(settings(), &fake, &hand), &knowledge, 1);
    assert_eq!((result, fake.count()), (Err(ModelError::PauseTooLong { pause_s: 31.0, limit_s: 30.0 }), 1));
    // Pauses count against the time of the question.
    let fake = Fake::new(|_| status(429, Some(25)));
    let short = LanguageSettings { total_timeout_s: 40.0, ..settings() };
    let _ = tags(&client(short, &fake, &hand), &knowledge, 1);
    assert_eq!(fake.count(), 2);
}

#[test]
fn a_server_that_is_away_is_left_alone_for_a_while() {
    let (knowledge, hand) = (knowledge(), Hand::default());
    let fake = Fake::new(|_| Err(ModelError::Unreachable { reason: "refused".into() }));
    let client = client(LanguageSettings { retries: 0, away_after: 3, away_s: 60.0, ..settings() }, &fake, &hand);
    for shade in 0..10 {
        let _ = tags(&client, &knowledge, shade);
    }
    assert_eq!(fake.count(), 3);
    assert!(matches!(tags(&client, &knowledge, 1), Err(ModelError::Away { .. })));
    hand.pause(61.0);
    let _ = tags(&client, &knowledge, 1);
    assert_eq!(fake.count(), 4);
}

#[test]
fn no_question_begins_that_could_break_the_budget() {
    let (knowledge, hand) = (knowledge(), Hand::default());
    let fake = Fake::new(|_| completion(json!({"things": ["mug"]})));
    let priced =
        LanguageSettings { price_input_usd: 1.0, price_output_usd: 10.0, budget_usd: Some(0.02), ..settings() };
    let client = client(priced, &fake, &hand);
    let ended: Vec<bool> = (0..20).map(|shade| tags(&client, &knowledge, shade).is_ok()).collect();
    let spent = client.spent();
    assert!(ended[0] && !ended[19], "{ended:?}");
    assert!(spent.cost_usd <= 0.02 && spent.cost_usd > 0.0, "{spent:?}");
    assert!((spent.cost_usd - 0.002 * fake.count() as f64).abs() < 1e-9, "{spent:?}");
    assert!(matches!(tags(&client, &knowledge, 99), Err(ModelError::Spent { .. })));
}

#[test]
fn no_more_requests_are_under_way_than_allowed() {
    let knowledge = knowledge();
    // Each request waits until a second one is there, as far as two are let in at all.
    let gate = Arc::new((Mutex::new(0_u32), Condvar::new()));
    let inside = gate.clone();
    let fake = Fake::new(move |_| {
        let mut arrived = inside.0.lock().unwrap();
        *arrived += 1;
        inside.1.notify_all();
        let wait = std::time::Duration::from_secs(20);
        let _ = inside.1.wait_timeout_while(arrived, wait, |arrived| *arrived < 2).unwrap();
        completion(json!({"things": []}))
    });
    let client = client(LanguageSettings { max_concurrent: 2, ..settings() }, &fake, &Hand::default());
    std::thread::scope(|scope| {
        for shade in 0..8 {
            let (client, knowledge) = (&client, &knowledge);
            scope.spawn(move || tags(client, knowledge, shade).unwrap());
        }
    });
    assert_eq!((fake.count(), fake.most_busy.load(Ordering::SeqCst)), (8, 2));
}

fn frame(number: u64, stamp_s: f64) -> Arc<RgbdFrame> {
    Arc::new(RgbdFrame {
        id: FrameId(number),
        stamp: Stamp::from_s(stamp_s),
        camera: "head".into(),
        model: CameraModel::from_vertical_fov(64, 48, 0.9),
        world_from_camera: dsm::Pose::identity(),
        color: vec![[number as u8; 3]; 64 * 48],
        depth_m: vec![1.0; 64 * 48],
    })
}

fn block(column: u32) -> Mask {
    let rows = (4..40).flat_map(move |row| (column..column + 20).map(move |c| row * 64 + c));
    Mask::from_sorted_pixels(64, rows)
}

/// Describes mark 1 as a mug.
fn describes(body: &str) -> Result<Reply, ModelError> {
    if body.contains("used_with") {
        return completion(json!({"relations": [{"from": 1, "kind": "used_with", "to": 2, "confidence": 0.9}]}));
    }
    completion(json!({"objects": [{"mark": 1, "name": "mug", "colors": ["red"], "pattern": "unknown",
        "texture": "unknown", "materials": ["ceramic"], "weight": "light", "smoothness": "unknown", "size": "small",
        "uses": [], "operate": []}]}))
}

/// Ten frames of two things, one a second; what shows when.
fn annotated(client: &Arc<Client>) -> Vec<(f64, Annotation)> {
    let mut annotator = LanguageAnnotator::new(client.clone(), knowledge());
    let masks = [block(4), block(36)];
    let mut shown = Vec::new();
    for number in 0..10 {
        let stamp_s = number as f64;
        let frame = frame(number, stamp_s);
        shown.extend(annotator.find_answers(frame.stamp).into_iter().map(|annotation| (stamp_s, annotation)));
        let seen = [(1, &masks[0]), (2, &masks[1])];
        let seen = seen.map(|(id, mask)| Sighting { object: ObjectId(id), mask, name: "thing" });
        annotator.ask(&frame, &seen);
    }
    shown.extend(annotator.finish().into_iter().map(|annotation| (f64::INFINITY, annotation)));
    shown
}

#[test]
fn late_answers_show_at_their_moment_and_replay_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let mut live = cached(folder.path(), Answers::Live);
    (live.frames.every_s, live.frames.latency_s) = (2.0, 3.0);
    let fake = Fake::new(describes);
    let once = annotated(&client(live.clone(), &fake, &Hand::default()));
    assert_eq!(once.len(), 2, "each thing is asked about twice, in one frame both");
    assert!(once.iter().all(|(shown_s, annotation)| *shown_s >= annotation.stamp.as_s() + 3.0));
    // From the cache alone, at any number of threads: the same words at the declared moments.
    let dead = Fake::new(|_| panic!("nothing may be sent"));
    let replay = |threads: u32, answers: Answers| {
        let settings = LanguageSettings { max_concurrent: threads, answers, ..live.clone() };
        annotated(&client(settings, &dead, &Hand::default()))
    };
    let again = replay(1, Answers::Cached);
    let moments: Vec<f64> = again.iter().map(|(shown_s, _)| *shown_s).collect();
    assert_eq!(moments, [3.0, 5.0]);
    let words = |shown: &[(f64, Annotation)]| shown.iter().map(|(_, words)| words.clone()).collect::<Vec<_>>();
    assert_eq!(words(&again), words(&once));
    assert_eq!(again, replay(8, Answers::Cached));
    assert_eq!(again, replay(8, Answers::Live));
    let first = &again[0].1;
    assert_eq!((first.frame, first.remarks[0].object, first.relations[0].to), (FrameId(0), ObjectId(1), ObjectId(2)));
}

#[test]
fn frames_keep_to_their_budget() {
    let fake = Fake::new(describes);
    let mut few = settings();
    (few.frames.every_s, few.frames.most_frames, few.frames.views_per_object) = (0.0, 3, 20);
    few.uses = vec![Use::Attributes];
    assert_eq!(annotated(&client(few.clone(), &fake, &Hand::default())).len(), 3);
    assert_eq!(fake.count(), 3);
    few.frames.min_pixels = 5000;
    assert!(annotated(&client(few.clone(), &fake, &Hand::default())).is_empty(), "things too small to be seen");
    few.vision = false;
    assert!(annotated(&client(few, &fake, &Hand::default())).is_empty(), "a model without eyes");
    assert_eq!(fake.count(), 3);
}

#[test]
fn a_slow_model_holds_nothing_up() {
    // The model answers only after the last frame was taken.
    let gate = Arc::new((Mutex::new(false), Condvar::new()));
    let inside = gate.clone();
    let fake = Fake::new(move |body| {
        let open = inside.0.lock().unwrap();
        let _open = inside.1.wait_while(open, |open| !*open).unwrap();
        describes(body)
    });
    let client = client(LanguageSettings { uses: vec![Use::Attributes], ..settings() }, &fake, &Hand::default());
    let mut annotator = LanguageAnnotator::new(client, knowledge());
    let mask = block(4);
    for number in 0..100 {
        let frame = frame(number, number as f64);
        assert!(annotator.find_answers(frame.stamp).is_empty());
        annotator.ask(&frame, &[Sighting { object: ObjectId(number), mask: &mask, name: "thing" }]);
    }
    *gate.0.lock().unwrap() = true;
    gate.1.notify_all();
    let late = annotator.finish();
    assert_eq!(late.len(), 4, "as many as may be under way");
    let frames: Vec<u64> = late.iter().map(|annotation| annotation.frame.0).collect();
    assert_eq!(frames, [0, 2, 4, 6], "in the order of their frames");
    assert!(late.iter().all(|annotation| annotation.remarks[0].object.0 == annotation.frame.0));
}
