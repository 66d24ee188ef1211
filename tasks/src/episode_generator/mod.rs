//! Episodes for generated homes: commands whose words mean exactly one thing there, and what must be true afterwards.
//!
//! This is the judging side: it reads what the bodies of a scene are, writes episode files, and nothing of it reaches a
//! run but the words of the commands.

mod disturb;
mod home;
mod open;
mod pass;
mod reach;
mod sequence;
mod words;

use crate::episode::EPISODE_VERSION;
pub use disturb::Disturb;
use dsm::knowledge::Knowledge;
use dsm_sim::disturb::DisturbanceKind;
use dsm_sim::scene::{SceneModel, Semantics};
use home::{Home, HomeObject};
use open::{find_closing, find_fetching, find_opening, find_parts};
use pass::{Passages, find_passing};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reach::Stands;
pub use sequence::write_sequences;
use std::fmt::Write;
use words::find_names;

/// Simulated time for an episode that begins in an unknown home, seconds: to see all of six rooms takes up to 350, and a
/// name alone is only settled then.
const TIME_LIMIT_S: f64 = 480.0;
/// The same when a thing is to be carried to another place.
const CARRY_LIMIT_S: f64 = 600.0;
/// The same when furniture is to be opened.
const OPEN_LIMIT_S: f64 = 600.0;
/// The same when the home is explored first: all of it, and time for the way after that.
const EXPLORED_LIMIT_S: f64 = 900.0;
/// How often a thing with at least two others of its class is chosen before one without.
const DISTRACTED_SHARE: f64 = 0.6;
/// A surface on which a thing is to be put holds at most this many things already.
const MOST_ON_SURFACE: usize = 3;

/// What an episode is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Kind {
    /// Drive to a piece of furniture.
    Navigate,
    /// Drive to a room.
    Room,
    /// Lift a thing.
    Grasp,
    /// Put a thing somewhere else.
    Place,
    /// Open a drawer; only in homes whose furniture is made to be opened.
    OpenDrawer,
    /// Open a hinged door of a piece of furniture; in such homes only.
    OpenDoor,
    /// Close a drawer that stands open; in such homes only.
    CloseDrawer,
    /// Close a hinged door that stands open; in such homes only.
    CloseDoor,
    /// Take a thing out of a closed drawer; in such homes only.
    FetchInside,
    /// Go to or lift what is in a room behind a closed door; only in homes with doors.
    PassDoor,
}

/// Homes take turns in which disturbances they get; so many homes differ.
const TURNS: usize = DisturbanceKind::ALL.len();

/// The kinds of a home's episodes, in turn, unless others are asked for.
pub const KINDS: [Kind; 8] =
    [Kind::Grasp, Kind::Navigate, Kind::Place, Kind::Grasp, Kind::Room, Kind::Grasp, Kind::Place, Kind::Navigate];

/// An episode file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GeneratedEpisode {
    /// Name of the file without its ending.
    pub name: String,
    /// Its text.
    pub text: String,
}

/// Writes up to `count` episodes for a home whose scene lies one folder above the episode files; fewer when the home
/// does not hold enough that words can tell apart. They are of these `kinds` in turn, and with `disturb` something happens
/// in each of them. The same arguments give the same texts.
pub fn write_episodes(
    model: &SceneModel,
    semantics: &Semantics,
    knowledge: &Knowledge,
    seed: u64,
    count: usize,
    (kinds, disturb): (&[Kind], Option<Disturb>),
) -> Vec<GeneratedEpisode> {
    // What can be asked for is the furniture with its doors closed.
    let held = &model.with_joints_held();
    let mut home = Home::read(held, semantics);
    let stands = Stands::find(&semantics.with_doorways_open(model).with_joints_held(), semantics);
    stands.drop_out_of_reach(&mut home);
    let passages = if kinds.contains(&Kind::PassDoor) { Passages::find(model, semantics) } else { Passages::default() };
    let parts = find_parts(&home, model);
    // What lies behind a closed front is asked for as such alone.
    for thing in parts.iter().flat_map(|part| &part.contents) {
        home.objects[*thing].graspable = false;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x6570_6973_6f64_6573);
    let mut used: Vec<String> = Vec::new();
    let mut episodes = Vec::new();
    // Every other drive is to be made on a finished map, and a home has one with each when it has two.
    let mut explored = seed % 2 == 1;
    // A kind that a home cannot offer is skipped; a second round makes up for it with the others.
    let rounds = count / kinds.len().max(1) + if disturb.is_some() { 2 * (count + 1) } else { 2 };
    // A disturbance that no task of a whole round suits gives its turn to the next.
    let (mut turn, mut misses) = (seed as usize % TURNS * count, 0);
    for kind in kinds.iter().cycle().take(kinds.len() * rounds) {
        if episodes.len() == count {
            break;
        }
        if misses == kinds.len() {
            (turn, misses) = (turn + 1, 0);
        }
        misses += 1;
        let disturbance = disturb.map(|disturb| disturb.kind_of(turn));
        if disturbance.is_some_and(|disturbance| !disturb::fits(disturbance, *kind)) {
            continue;
        }
        let task = match kind {
            Kind::OpenDrawer => find_opening(true, &home, &parts, &stands, knowledge, &mut used, &mut rng),
            Kind::OpenDoor => find_opening(false, &home, &parts, &stands, knowledge, &mut used, &mut rng),
            Kind::CloseDrawer => find_closing(true, &home, &parts, &stands, knowledge, &mut used, &mut rng),
            Kind::CloseDoor => find_closing(false, &home, &parts, &stands, knowledge, &mut used, &mut rng),
            Kind::FetchInside => find_fetching(&home, &parts, &stands, knowledge, &mut used, &mut rng),
            Kind::PassDoor => find_passing(&passages, &home, knowledge, &mut used, &mut rng),
            kind => find_task(*kind, disturbance, &home, knowledge, &mut used, &mut rng),
        };
        let Some(mut task) = task else { continue };
        if let Some(disturbance) = disturbance
            && !task.disturb(disturbance, *kind, &home, seed, episodes.len())
        {
            continue;
        }
        (turn, misses) = (turn + 1, 0);
        if matches!(kind, Kind::Navigate | Kind::Room) {
            explored = !explored;
            if explored {
                task.explores_first = true;
                task.time_limit_s = EXPLORED_LIMIT_S;
            }
        }
        let number = episodes.len() + 1;
        episodes.push(GeneratedEpisode {
            name: format!("{}_{number}_{}", semantics.name, task.kind),
            text: task.write(&semantics.name, seed),
        });
    }
    episodes
}

/// A command and what it must lead to.
struct Task {
    /// Body that it is about; none for rooms.
    body: Option<String>,
    /// What disturbs it, as its file has it.
    disturbance: String,
    /// What is so at the start, as its file has it: what stands open, where the robot stands.
    start: String,
    kind: &'static str,
    why: String,
    command: String,
    expect: String,
    time_limit_s: f64,
    explores_first: bool,
}

impl Task {
    fn write(&self, scene: &str, seed: u64) -> String {
        let mut text = format!("# Generated for {scene}. {}\nversion = {EPISODE_VERSION}\n", self.why);
        let explore = if self.explores_first { "[[step]]\nskill = \"explore\"\n\n" } else { "" };
        let _ = write!(
            text,
            "scene = \"../scene.xml\"\nrobot = \"porter\"\nseed = {seed}\ntime_limit_s = {}\n\n{explore}[[step]]\ncommand = \"{}\"\n\n\
             [[expect]]\n{}\n{}{}",
            self.time_limit_s, self.command, self.expect, self.start, self.disturbance
        );
        text
    }
}

fn find_task(
    kind: Kind,
    disturbance: Option<DisturbanceKind>,
    home: &Home,
    knowledge: &Knowledge,
    used: &mut Vec<String>,
    rng: &mut ChaCha8Rng,
) -> Option<Task> {
    match kind {
        Kind::OpenDrawer
        | Kind::OpenDoor
        | Kind::CloseDrawer
        | Kind::CloseDoor
        | Kind::FetchInside
        | Kind::PassDoor => None,
        Kind::Room => {
            let rooms: Vec<&String> = home.rooms.iter().filter(|room| !used.contains(room)).collect();
            let room = (*rooms.get(rng.random_range(0..rooms.len().max(1)))?).clone();
            used.push(room.clone());
            Some(Task {
                body: None,
                disturbance: String::new(),
                start: String::new(),
                kind: "room",
                why: "Only what stands in a room tells which it is.".into(),
                command: format!("Go to the {room}"),
                expect: format!("kind = \"robot_near\"\nroom = \"{room}\""),
                time_limit_s: TIME_LIMIT_S,
                explores_first: false,
            })
        }
        Kind::Navigate => {
            let goals = |object: &HomeObject| !object.free && object.stands;
            let (body, name, others) = choose(home, knowledge, &goals, &|_, _| true, used, rng)?;
            let verb = ["Go to", "Navigate to", "Drive to"][rng.random_range(0..3)];
            Some(Task {
                body: Some(body.clone()),
                disturbance: String::new(),
                start: String::new(),
                kind: "navigate",
                why: others,
                command: format!("{verb} the {name}"),
                expect: format!("kind = \"robot_near\"\nobject = \"{body}\""),
                time_limit_s: TIME_LIMIT_S,
                explores_first: false,
            })
        }
        Kind::Grasp => {
            let means =
                |index: usize, name: &str| disturbance.is_none_or(|d| disturb::keeps_meaning(d, home, index, name));
            let (body, name, others) = choose(home, knowledge, &|object| object.graspable, &means, used, rng)?;
            let verb = ["Grasp", "Pick up", "Take"][rng.random_range(0..3)];
            Some(Task {
                body: Some(body.clone()),
                disturbance: String::new(),
                start: String::new(),
                kind: "grasp",
                why: others,
                command: format!("{verb} the {name}"),
                expect: format!("kind = \"object_lifted\"\nobject = \"{body}\""),
                time_limit_s: TIME_LIMIT_S,
                explores_first: false,
            })
        }
        Kind::Place => {
            let (body, name, others) = choose(home, knowledge, &|object| object.graspable, &|_, _| true, used, rng)?;
            let (surface, surface_name) = choose_surface(home, knowledge, &body, rng)?;
            let command = if rng.random::<bool>() {
                format!("Put the {name} on the {surface_name}")
            } else {
                format!("Bring the {name} to the {surface_name}")
            };
            Some(Task {
                body: Some(body.clone()),
                disturbance: String::new(),
                start: String::new(),
                kind: "place",
                why: others,
                command,
                expect: format!("kind = \"object_on\"\nobject = \"{body}\"\nsurface = \"{surface}\""),
                time_limit_s: CARRY_LIMIT_S,
                explores_first: false,
            })
        }
    }
}

/// A body that was not used yet, words that mean it alone and suit what they are for, and how many others of its class there are.
fn choose(
    home: &Home,
    knowledge: &Knowledge,
    wanted: &dyn Fn(&HomeObject) -> bool,
    means: &dyn Fn(usize, &str) -> bool,
    used: &mut Vec<String>,
    rng: &mut ChaCha8Rng,
) -> Option<(String, String, String)> {
    let mut candidates: Vec<usize> = (0..home.objects.len())
        .filter(|i| wanted(&home.objects[*i]) && !used.contains(&home.objects[*i].body))
        .collect();
    candidates.shuffle(rng);
    let others = |index: &usize| home.count_others(*index);
    if rng.random::<f64>() < DISTRACTED_SHARE {
        candidates.sort_by_key(|index| others(index) < 2);
    }
    candidates.into_iter().find_map(|index| {
        let mut names = find_names(index, home, knowledge);
        names.retain(|name| means(index, name));
        let name = names.get(rng.random_range(0..names.len().max(1)))?.clone();
        let object = &home.objects[index];
        used.push(object.body.clone());
        let why = match others(&index) {
            0 => format!("The only {} here.", object.category),
            1 => format!("There is one other {}.", object.category),
            n => format!("There are {n} others of the class {}.", object.category),
        };
        Some((object.body.clone(), name, why))
    })
}

/// A surface other than the one that carries the body, named by its category alone, with room on it.
fn choose_surface(home: &Home, knowledge: &Knowledge, body: &str, rng: &mut ChaCha8Rng) -> Option<(String, String)> {
    let now_on = home.objects.iter().find(|object| object.body == body)?.support;
    let mut surfaces: Vec<usize> = (0..home.objects.len())
        .filter(|i| Some(*i) != now_on && home.objects[*i].is_surface && home.count_on(*i) <= MOST_ON_SURFACE)
        .collect();
    surfaces.shuffle(rng);
    surfaces.into_iter().find_map(|index| {
        let object = &home.objects[index];
        home.is_only(index, &|other| home.is_called(other, &object.category, knowledge))
            .then(|| (object.body.clone(), object.category.clone()))
    })
}

#[cfg(test)]
mod tests;
