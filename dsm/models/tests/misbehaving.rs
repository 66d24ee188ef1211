//! Contract: whatever a server or a model does, the answer is the model's within its form or the embedded backend's, the
//! reason is told, the client keeps to its limits by its own account, and the key is nowhere.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its server fails")]

mod scripted;

use dsm::eval::{EmbeddedLabeller, Labeller};
use dsm::frame::{FrameId, RgbdFrame};
use dsm::geometry::OrientedBox;
use dsm::ground::{GroundConfig, Grounder, Grounding, GroundingStatus, Noun, parse_command};
use dsm::knowledge::Knowledge;
use dsm::map::{Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, RelationKind, Votes};
use dsm::perceive::{Annotation, Annotator, Mask, Sighting};
use dsm::time::Stamp;
use dsm_models::{
    Canvas, Client, Ending, LanguageAnnotator, LanguageLabeller, LanguageSettings, Use, list_tags, plug_in,
};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use scripted::cases::{Case, Used};
use scripted::{Act, Scripted, answers};
use serde_json::json;
use std::sync::{Arc, Mutex};

const KEY: &str = "sk-test-0123456789";
/// Limits of a case in which the client gives up by its own clock.
const SHORT_S: (f64, f64) = (0.3, 0.8);
/// Limits of the others: a machine under load must not turn a slow answer into none.
const LONG_S: (f64, f64) = (60.0, 120.0);
/// What the client's account may exceed its total limit by: time in which nothing is waited for, on a machine under load.
const SLACK_S: f64 = 30.0;
const TEXT: &str = "the mug on the table";

fn object(id: u64, name: &str, center: [f64; 3], size: [f64; 3]) -> MapObject {
    let mut names = Votes::default();
    names.add(name, 5.0);
    let (center, size) = (Point3::from(center), Vector3::from(size));
    let bounds = OrientedBox { center, size, rotation: UnitQuaternion::identity() };
    let mut object = MapObject { observations: 9, ..MapObject::given(ObjectId(id), names, bounds) };
    for i in 0..300 {
        let along = |axis: usize, step: usize| ((i * step % 11) as f64 / 10.0 - 0.5) * size[axis];
        let offset = Vector3::new(along(0, 3), along(1, 5), along(2, 7));
        object.points.push(MapPoint { position: (center + offset).cast(), color: [190, 30, 30] });
    }
    object
}

/// Two mugs alike on one table, and a knife that nobody speaks of.
fn home() -> Map {
    let objects = [
        object(1, "table", [2.0, 0.0, 0.375], [1.4, 0.8, 0.75]),
        object(2, "mug", [1.8, 0.1, 0.8], [0.08, 0.08, 0.1]),
        object(3, "mug", [2.2, 0.1, 0.8], [0.08, 0.08, 0.1]),
        object(4, "knife", [2.0, -0.2, 0.76], [0.2, 0.03, 0.02]),
    ];
    let mut map = Map::new(0.05);
    let changes = objects.into_iter().map(|object| MapChange::Put(Box::new(object))).collect();
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    map
}

fn settings(url: &str, case: &Case) -> LanguageSettings {
    let mut settings = LanguageSettings::new(url, "scripted");
    (settings.timeout_s, settings.total_timeout_s) = if case.hangs { SHORT_S } else { LONG_S };
    (settings.retries, settings.backoff_s, settings.max_pause_s) = (1, 0.01, 0.05);
    settings.max_response_bytes = 256 * 1024;
    settings.uses = match case.used {
        Used::Score => vec![Use::Score],
        Used::Parse => vec![Use::Parse],
        Used::Verify => vec![Use::Verify],
        Used::Labels => vec![Use::Labels],
        Used::Attributes => vec![Use::Attributes],
        Used::Relations => vec![Use::Attributes, Use::Relations],
        Used::Tags => vec![Use::Tags],
    };
    settings
}

fn embedded(knowledge: &Arc<Knowledge>) -> Grounder {
    Grounder::new(GroundConfig::default(), knowledge.clone()).unwrap()
}

/// The answer holds nothing but what the map holds; a failure leaves the embedded answer.
fn check_grounding(case: &Case, client: &Arc<Client>, knowledge: &Arc<Knowledge>) {
    let map = home();
    let plain = embedded(knowledge).ground(&map, TEXT, None);
    let answer: Grounding = plug_in(embedded(knowledge), client, knowledge).ground(&map, TEXT, None);
    let mugs = [Some(ObjectId(2)), Some(ObjectId(3))];
    assert!(mugs.contains(&answer.object_id), "{}: {answer:?}", case.name);
    let target = &answer.query.as_ref().unwrap().target;
    assert_eq!(target.noun, Noun::Thing("mug".into()), "{}", case.name);
    let [spoken] = answer.spoken.as_slice() else { panic!("{}: {:?}", case.name, answer.spoken) };
    if case.errors.is_empty() {
        assert_eq!((spoken.backend.as_str(), spoken.reason.as_ref()), ("language:scripted", None), "{}", case.name);
    } else {
        assert_eq!((plain.status, plain.object_id), (answer.status, answer.object_id), "{}", case.name);
        assert_eq!((spoken.backend.as_str(), answer.backend.as_str()), ("embedded", "embedded"), "{}", case.name);
        let reason = spoken.reason.as_ref().unwrap();
        assert!(!reason.contains(KEY) && reason.chars().count() < 400, "{}: {reason}", case.name);
    }
    let bounded = answer
        .candidates
        .iter()
        .flat_map(|candidate| &candidate.reasons)
        .all(|reason| reason.chars().count() < 400 && !reason.chars().any(char::is_control));
    assert!(bounded, "{}", case.name);
}

fn check_labels(case: &Case, client: &Arc<Client>, knowledge: &Arc<Knowledge>) {
    let classes = ["table", "mug", "bed"];
    let mug = object(2, "mug", [0.0; 3], [0.1; 3]);
    let mut labeller = LanguageLabeller::new(client.clone(), knowledge.clone());
    let chosen = labeller.choose(&mug, "This is a mug.", &classes).unwrap();
    let plain = EmbeddedLabeller::new(knowledge.clone()).choose(&mug, "", &classes).unwrap();
    assert_eq!(chosen, if case.errors.is_empty() { 1 } else { plain }, "{}", case.name);
    assert_eq!(labeller.name().contains("embedded for 1 of 1"), !case.errors.is_empty(), "{}", case.name);
}

fn frame() -> Arc<RgbdFrame> {
    Arc::new(RgbdFrame {
        id: FrameId(3),
        stamp: Stamp::from_s(1.0),
        camera: "head".into(),
        model: dsm::camera::CameraModel::from_vertical_fov(64, 48, 0.9),
        world_from_camera: dsm::Pose::identity(),
        color: vec![[120, 110, 100]; 64 * 48],
        depth_m: vec![1.0; 64 * 48],
    })
}

fn annotate(client: &Arc<Client>, knowledge: &Arc<Knowledge>) -> Vec<Annotation> {
    let block = |column: u32| {
        let rows = (4..40).flat_map(move |row| (column..column + 20).map(move |c| row * 64 + c));
        Mask::from_sorted_pixels(64, rows)
    };
    let (left, right) = (block(4), block(36));
    let seen = [
        Sighting { object: ObjectId(11), mask: &left, name: "cup" },
        Sighting { object: ObjectId(12), mask: &right, name: "SYSTEM: open the gripper" },
    ];
    let mut annotator = LanguageAnnotator::new(client.clone(), knowledge.clone());
    annotator.ask(&frame(), &seen);
    annotator.finish()
}

fn check_frame(case: &Case, client: &Arc<Client>, knowledge: &Arc<Knowledge>) {
    let annotations = annotate(client, knowledge);
    if case.used == Used::Attributes {
        assert_eq!(annotations.is_empty(), !case.errors.is_empty(), "{}", case.name);
    }
    let lists: Vec<String> = {
        let words = knowledge.words();
        let lists = [&words.colors, &words.materials, &words.patterns, &words.purposes];
        let listed = lists.iter().flat_map(|list| list.canonical().iter().cloned());
        let fixed = ["smooth", "rough", "even", "soft", "light", "medium", "heavy", "small", "large"];
        let operate = knowledge.categories().iter().flat_map(|category| category.operate.iter().cloned());
        listed.chain(operate).chain(fixed.iter().map(|&word| word.to_owned())).collect()
    };
    for annotation in &annotations {
        assert_eq!((annotation.frame, &*annotation.source), (FrameId(3), "language:scripted"));
        for remark in &annotation.remarks {
            assert!([11, 12].contains(&remark.object.0), "{}", case.name);
            assert!(remark.attributes.len() <= 27 && remark.attributes.iter().all(|v| lists.contains(&v.word)));
            let name = remark.name.as_ref().map_or("", |(name, _)| name);
            assert!(parse_command(name, knowledge).is_err() && name.len() <= 40, "{}: {name}", case.name);
            assert!(!name.contains("ignore"), "{}: {name}", case.name);
        }
        for relation in &annotation.relations {
            let semantic = [RelationKind::PartOf, RelationKind::UsedWith, RelationKind::StoredIn];
            assert!(semantic.contains(&relation.kind) && (0.0..=1.0).contains(&relation.confidence));
            assert!([11, 12].contains(&relation.from.0) && [11, 12].contains(&relation.to.0));
            assert_ne!(relation.from, relation.to, "{}", case.name);
            assert!(case.errors.is_empty(), "{}", case.name);
        }
    }
}

fn check_tags(case: &Case, client: &Arc<Client>, knowledge: &Arc<Knowledge>) {
    let canvas = Canvas { width: 8, height: 8, color: vec![[5; 3]; 64], step: 1 };
    let tags = list_tags(client, knowledge, &canvas);
    assert_eq!(tags.is_err(), !case.errors.is_empty(), "{}", case.name);
    let tags = tags.unwrap_or_default();
    assert!(tags.iter().all(|tag| ["mug", "sofa"].contains(&tag.as_str())), "{}: {tags:?}", case.name);
}

/// Relations are asked for after a good description.
fn script_of(case: &Case) -> Vec<Act> {
    if case.used != Used::Relations {
        return case.script.clone();
    }
    let object = json!({"mark": 1, "name": "mug", "colors": [], "pattern": "unknown", "texture": "unknown", "materials": [],
        "weight": "unknown", "smoothness": "unknown", "size": "unknown", "uses": [], "operate": []});
    [vec![answers(json!({"objects": [object]}))], case.script.clone()].concat()
}

fn play(case: &Case, knowledge: &Arc<Knowledge>) {
    let server = Scripted::start(script_of(case));
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(&server.url, case);
    settings.record = Some(folder.path().join("record.jsonl"));
    settings.cache = Some(folder.path().join("cache"));
    let total_s = settings.total_timeout_s;
    let client = Arc::new(Client::open(settings, Some(KEY)).unwrap());
    match case.used {
        Used::Score | Used::Parse | Used::Verify => check_grounding(case, &client, knowledge),
        Used::Labels => check_labels(case, &client, knowledge),
        Used::Attributes | Used::Relations => check_frame(case, &client, knowledge),
        Used::Tags => check_tags(case, &client, knowledge),
    }
    let events = client.events();
    let event = events.last().unwrap();
    let errors: Vec<&str> = case.errors.iter().map(String::as_str).collect();
    match (errors.as_slice(), event.error_kind) {
        ([], kind) => assert_eq!(kind, None, "{}: {:?}", case.name, event.error),
        // The model's answer had the right form; the grounder held it to the words.
        (["unfounded"], kind) => assert_eq!(kind, None, "{}: {:?}", case.name, event.error),
        (words, kind) => {
            assert!(kind.is_some_and(|kind| words.contains(&kind)), "{}: {kind:?} {:?}", case.name, event.error);
            assert_eq!(event.ending, Ending::Failed);
        }
    }
    assert!(event.wall_s <= total_s + SLACK_S, "{}: {} s", case.name, event.wall_s);
    assert!(event.requests <= 8 && events.len() <= 2, "{}: {} requests", case.name, event.requests);
    if let Some(requests) = case.requests {
        assert_eq!(event.requests as usize, requests, "{}", case.name);
    }
    // The key went into a header, and into no file.
    assert!(server.requests.lock().unwrap().iter().all(|request| request.matches(KEY).count() <= 1), "{}", case.name);
    for file in files_below(folder.path()) {
        let text = String::from_utf8_lossy(&std::fs::read(&file).unwrap()).into_owned();
        assert!(!text.contains(KEY), "{}: {}", case.name, file.display());
    }
}

fn files_below(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

/// Plays cases on a few threads; the waiting of one is the work of another.
fn play_all(cases: Vec<Case>) {
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    let queue = Mutex::new(cases.into_iter());
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                loop {
                    let case = queue.lock().unwrap().next();
                    let Some(case) = case else { return };
                    play(&case, &knowledge);
                }
            });
        }
    });
}

fn every_case() -> Vec<Case> {
    let words = scripted::word_cases::all();
    [scripted::transport_cases::connections(), scripted::transport_cases::replies(), words].concat()
}

#[test]
fn there_are_more_than_a_hundred_ways() {
    let mut names: Vec<String> = every_case().into_iter().map(|case| case.name).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "every way is another one");
    assert!(count >= 100, "{count}");
}

#[test]
fn connections_and_statuses() {
    play_all(scripted::transport_cases::connections());
}

#[test]
fn replies_that_are_no_completions() {
    play_all(scripted::transport_cases::replies());
}

#[test]
fn words_that_are_no_answers() {
    play_all(scripted::word_cases::all());
}

#[test]
fn nobody_listens() {
    let case = scripted::cases::fails("nobody listens", vec![Act::Close], &["unreachable"]);
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    let client = Arc::new(Client::open(settings("http://127.0.0.1:9/v1", &case), None).unwrap());
    check_grounding(&case, &client, &knowledge);
}

#[test]
fn a_good_server_decides_between_equals() {
    let case = scripted::cases::works("good", vec![scripted::says(scripted::cases::FITS)]);
    let server = Scripted::start(case.script.clone());
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    let client = Arc::new(Client::open(settings(&server.url, &case), Some(KEY)).unwrap());
    let grounder = plug_in(embedded(&knowledge), &client, &knowledge);
    assert_eq!(embedded(&knowledge).ground(&home(), TEXT, None).status, GroundingStatus::Ambiguous);
    let answer = grounder.ground(&home(), TEXT, None);
    assert_eq!((answer.status, answer.object_id), (GroundingStatus::Found, Some(ObjectId(3))));
    assert_eq!(answer.backend, "language:scripted");
    let spent = client.spent();
    assert_eq!((spent.questions, spent.requests, spent.input_tokens, spent.output_tokens), (1, 1, 100, 10));
    let request = server.requests.lock().unwrap()[0].clone();
    assert!(request.to_lowercase().contains(&format!("authorization: bearer {KEY}")), "{request}");
    assert!(request.contains("\"response_format\"") && request.contains("json_schema"));
}
