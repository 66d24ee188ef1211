//! Generated episodes of three commands in one sentence. Each part has one expectation, in order, so that what a robot says
//! of each part can be held against the truth.

use super::home::Home;
use super::reach::Stands;
use super::{GeneratedEpisode, Kind, Task, find_task};
use crate::episode::EPISODE_VERSION;
use dsm::knowledge::Knowledge;
use dsm_sim::scene::{SceneModel, Semantics};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;

/// Simulated time: a home is seen once, and each thing is fetched and carried like in an episode of its own.
const TIME_LIMIT_S: f64 = 1200.0;

/// Writes up to `count` episodes for a home whose scene lies one folder above them; fewer when the home does not hold
/// enough. The same arguments give the same texts.
pub fn write_sequences(
    model: &SceneModel,
    semantics: &Semantics,
    knowledge: &Knowledge,
    seed: u64,
    count: usize,
) -> Vec<GeneratedEpisode> {
    // What can be asked for is the furniture with its doors closed.
    let mut home = Home::read(&model.with_joints_held(), semantics);
    Stands::find(&semantics.with_doorways_open(model).with_joints_held(), semantics).drop_out_of_reach(&mut home);
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7365_7175_656e_6365);
    let mut used = Vec::new();
    let mut episodes = Vec::new();
    while episodes.len() < count {
        let mut find = |kind| find_task(kind, None, &home, knowledge, &mut used, &mut rng);
        let parts = match episodes.len() % 3 {
            0 => [Kind::Place, Kind::Place, Kind::Navigate].map(&mut find).into_iter().collect::<Option<Vec<Task>>>(),
            1 => find(Kind::Place).zip(find(Kind::Grasp)).and_then(|(placed, last)| {
                let [taken, put] = taken_and_put(&placed)?;
                Some(vec![taken, put, last])
            }),
            _ => [Kind::Place, Kind::Place, Kind::Grasp].map(&mut find).into_iter().collect(),
        };
        let Some(parts) = parts else { break };
        let number = episodes.len() + 1;
        let name = format!("{}_{number}_sequence", semantics.name);
        episodes.push(GeneratedEpisode { name, text: write(&parts, &semantics.name, seed) });
    }
    episodes
}

/// "Put the mug on the desk" as two parts: take it, then put it there.
fn taken_and_put(placed: &Task) -> Option<[Task; 2]> {
    let (thing, place) = placed.command.split_once(" the ")?.1.rsplit_once(" the ")?;
    let thing = thing.strip_suffix(" on").or_else(|| thing.strip_suffix(" to"))?;
    let part = |command: String, expect: String| Task {
        body: placed.body.clone(),
        disturbance: String::new(),
        start: String::new(),
        kind: "sequence",
        why: placed.why.clone(),
        command,
        expect,
        time_limit_s: placed.time_limit_s,
        explores_first: false,
    };
    let lifted = format!("kind = \"object_lifted\"\nobject = \"{}\"", placed.body.as_ref()?);
    let taken = part(format!("Take the {thing}"), lifted);
    let put = part(format!("put it on the {place}"), placed.expect.clone());
    Some([taken, put])
}

fn write(parts: &[Task], scene: &str, seed: u64) -> String {
    let mut command = String::new();
    for (index, part) in parts.iter().enumerate() {
        let joint = ["", ", then ", ", and then "][index.min(2)];
        let mut words = part.command.clone();
        if index > 0 {
            words[..1].make_ascii_lowercase();
        }
        command = command + joint + &words;
    }
    let mut text = format!(
        "# Generated for {scene}: {} commands in one sentence.\nversion = {EPISODE_VERSION}\nscene = \"../scene.xml\"\n\
         robot = \"porter\"\nseed = {seed}\ntime_limit_s = {TIME_LIMIT_S}\n\n[[step]]\ncommand = \"{command}\"\n",
        parts.len()
    );
    for part in parts {
        let _ = write!(text, "\n[[expect]]\n{}\n", part.expect);
    }
    text
}
