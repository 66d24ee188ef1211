//! Asks a real server everything that can be asked in words, and tells how well it keeps to the protocol:
//! `cargo run --release -p dsm-models --example protocol -- FILE [TIMES]`, with a file of models. `llama_check/run.sh` starts
//! a server of its own and runs this; docs/models.md has the result.
//!
//! It says nothing of how good the answers are. Exit code 1 when something is not as promised.

#![allow(clippy::print_stdout, reason = "an example that prints its result")]
#![allow(clippy::disallowed_methods, reason = "times are what it measures")]

use dsm::eval::Labeller;
use dsm::geometry::OrientedBox;
use dsm::ground::{GroundConfig, Grounder};
use dsm::knowledge::Knowledge;
use dsm::map::{Map, MapChange, MapObject, MapUpdate, ObjectId, Votes};
use dsm::time::Stamp;
use dsm_models::wall::{SystemWall, Wall};
use dsm_models::{
    Canvas, Client, Ending, Event, LanguageLabeller, LanguageSettings, ModelSettings, Use, list_tags, plug_in,
};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::path::Path;
use std::sync::Arc;

/// What is asked about the map.
const TEXTS: [&str; 8] = [
    "the mug on the table",
    "the red apple on the white shelf",
    "the chair closest to the desk",
    "the book between the lamp and the mug",
    "a wooden bowl",
    "the largest box in the kitchen",
    "the mug that is not on the table",
    "something to drink from",
];
/// Labels of a benchmark.
const CLASSES: [&str; 6] = ["mug", "table", "apple", "chair", "shelf", "book"];
/// A limit within which no model answers.
const SHORT_S: f64 = 0.15;
/// Threads that ask at once.
const CROWD: usize = 8;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("expected the path of a file of models")?;
    let times: usize = arguments.next().map_or(Ok(2), |times| times.parse())?;
    let settings = ModelSettings::load(Path::new(&file))?.language.ok_or("the file has no [language]")?;
    let mut failures = Vec::new();
    words(&settings, times, &mut failures)?;
    pictures(&settings, &mut failures)?;
    crowd(&settings, &mut failures)?;
    cancel(&settings, &mut failures)?;
    if failures.is_empty() {
        println!("all as promised");
        return Ok(());
    }
    Err(failures.join("; ").into())
}

/// A client that asks nothing of a cache.
fn client(settings: &LanguageSettings, change: impl FnOnce(&mut LanguageSettings)) -> Result<Arc<Client>, Failure> {
    let mut settings = LanguageSettings { cache: None, ..settings.clone() };
    change(&mut settings);
    let key = settings.get_key(Path::new("the file of models"))?;
    Ok(Arc::new(Client::open(settings, key.as_deref())?))
}

/// Every use in words, `times` over.
fn words(settings: &LanguageSettings, times: usize, failures: &mut Vec<String>) -> Result<(), Failure> {
    let knowledge = Arc::new(Knowledge::embedded()?);
    let map = home();
    for wanted in [Use::Parse, Use::Score, Use::Labels] {
        let client = client(settings, |settings| settings.uses = vec![wanted])?;
        for turn in 0..times {
            if wanted == Use::Labels {
                let mut labeller = LanguageLabeller::new(client.clone(), knowledge.clone());
                for object in map.objects.values() {
                    let sentence =
                        format!("Number {turn}. This is a {} of {:.1} m.", object.name(), object.bounds.size.x);
                    labeller.choose(object, &sentence, &CLASSES)?;
                }
                continue;
            }
            let grounder = plug_in(Grounder::new(GroundConfig::default(), knowledge.clone())?, &client, &knowledge);
            for text in TEXTS {
                grounder.ground(&map, text, None);
            }
        }
        tell(wanted.word(), &client, times, failures);
    }
    Ok(())
}

/// One line on a use. Answers may be refused for what they say; they must be JSON of the form that was asked for.
fn tell(what: &str, client: &Client, times: usize, failures: &mut Vec<String>) {
    let events = client.events();
    let ended = |ending: Ending| events.iter().filter(|event| event.ending == ending).count();
    let valid = events.iter().filter(|event| is_in_form(event)).count();
    let spent = client.spent();
    let seconds = spent.wall_s.max(1e-9);
    println!(
        "{what}: {} questions, {} answered, {} after repair, {} refused for what they say, {valid} in form; {:.2} s each, \
         {:.1} tokens written a second",
        events.len(),
        ended(Ending::Answered),
        ended(Ending::Repaired),
        ended(Ending::Failed),
        seconds / events.len().max(1) as f64,
        spent.output_tokens as f64 / seconds,
    );
    if events.len() < times || valid < events.len() {
        let why: Vec<&str> = events.iter().filter(|e| !is_in_form(e)).filter_map(|e| e.error.as_deref()).collect();
        failures.push(format!("{what}: {valid} of {} answers in form: {}", events.len(), why.join(", ")));
    }
}

/// Whether the last answer is JSON with the two parts that every answer has.
fn is_in_form(event: &Event) -> bool {
    let value: Result<serde_json::Value, _> = serde_json::from_str(&event.answer);
    value.is_ok_and(|value| value.get("answer").is_some() && value.get("thought").is_some())
}

/// A model without eyes is asked to look: its server refuses, and that is told.
fn pictures(settings: &LanguageSettings, failures: &mut Vec<String>) -> Result<(), Failure> {
    let client = client(settings, |settings| (settings.vision, settings.uses) = (true, vec![Use::Tags]))?;
    let canvas = Canvas { width: 32, height: 24, color: vec![[200, 30, 30]; 32 * 24], step: 1 };
    match list_tags(&client, &Knowledge::embedded()?, &canvas) {
        Ok(tags) => println!("pictures: taken; it names {}", tags.join(", ")),
        Err(error) => {
            println!("pictures: {error}");
            if !matches!(error.word(), "refused" | "failing") {
                failures.push(format!("pictures: {error}"));
            }
        }
    }
    Ok(())
}

/// Many ask at once: all are answered, and no more at a time than may be.
fn crowd(settings: &LanguageSettings, failures: &mut Vec<String>) -> Result<(), Failure> {
    let wall = SystemWall::new();
    let knowledge = Arc::new(Knowledge::embedded()?);
    let map = home();
    let mut seconds = Vec::new();
    for most in [1, 4] {
        let client = client(settings, |settings| {
            (settings.uses, settings.max_concurrent) = (vec![Use::Labels], most);
            settings.total_timeout_s = 600.0;
        })?;
        let start_s = wall.now_s();
        std::thread::scope(|scope| {
            for number in 0..CROWD {
                let (client, knowledge, map) = (client.clone(), knowledge.clone(), &map);
                scope.spawn(move || {
                    let mut labeller = LanguageLabeller::new(client, knowledge);
                    let object = &map.objects[&ObjectId(1 + number as u64 % 4)];
                    labeller.choose(object, &format!("Thing {number} of {most}: a {}.", object.name()), &CLASSES)
                });
            }
        });
        seconds.push(wall.now_s() - start_s);
        let answered = client.events().iter().filter(|event| event.ending != Ending::Failed).count();
        if answered < CROWD {
            failures.push(format!("crowd: {answered} of {CROWD} answered with {most} at a time"));
        }
    }
    println!("crowd: {CROWD} questions at once; {:.1} s one at a time, {:.1} s four at a time", seconds[0], seconds[1]);
    Ok(())
}

/// A question is given up; the server is free for the next one.
fn cancel(settings: &LanguageSettings, failures: &mut Vec<String>) -> Result<(), Failure> {
    let knowledge = Arc::new(Knowledge::embedded()?);
    let map = home();
    let impatient = client(settings, |settings| {
        settings.uses = vec![Use::Parse];
        (settings.timeout_s, settings.total_timeout_s, settings.retries) = (SHORT_S, SHORT_S, 0);
        settings.away_after = 100;
    })?;
    let embedded = Grounder::new(GroundConfig::default(), knowledge.clone())?;
    let grounder = plug_in(embedded, &impatient, &knowledge);
    for text in TEXTS {
        let answer = grounder.ground(&map, text, None);
        if answer.backend != "embedded" {
            failures.push(format!("cancel: {} answered within {SHORT_S} s", answer.backend));
        }
    }
    let longest = impatient.events().iter().map(|event| event.wall_s).fold(0.0, f64::max);
    let patient = client(settings, |settings| settings.uses = vec![Use::Labels])?;
    let mut labeller = LanguageLabeller::new(patient.clone(), knowledge);
    labeller.choose(&map.objects[&ObjectId(2)], "This is a mug.", &CLASSES)?;
    let after_s = patient.spent().wall_s;
    if patient.spent().failed > 0 {
        failures.push("cancel: the server does not answer afterwards".to_owned());
    }
    println!(
        "cancel: {} questions given up after at most {longest:.2} s each, the embedded grammar answered; the next question \
         is answered in {after_s:.2} s",
        TEXTS.len()
    );
    Ok(())
}

/// Two mugs, a table and an apple.
fn home() -> Map {
    let things = [
        (1, "table", [2.0, 0.0, 0.375], [1.4, 0.8, 0.75]),
        (2, "mug", [1.8, 0.1, 0.8], [0.08, 0.08, 0.1]),
        (3, "mug", [2.2, 0.1, 0.8], [0.08, 0.08, 0.1]),
        (4, "apple", [2.0, -0.2, 0.79], [0.08, 0.08, 0.08]),
    ];
    let object = |(id, name, center, size): (u64, &str, [f64; 3], [f64; 3])| {
        let mut names = Votes::default();
        names.add(name, 5.0);
        let (center, size) = (Point3::from(center), Vector3::from(size));
        MapObject::given(ObjectId(id), names, OrientedBox { center, size, rotation: UnitQuaternion::identity() })
    };
    let mut map = Map::new(0.05);
    let changes = things.map(|thing| MapChange::Put(Box::new(object(thing)))).into();
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    map
}
