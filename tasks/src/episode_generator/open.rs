//! Commands to open and close drawers and doors: which ones a robot can get at, and what they are called.

use super::home::Home;
use super::reach::Stands;
use super::words::find_names;
use super::{OPEN_LIMIT_S, Task};
use dsm::knowledge::Knowledge;
use dsm_sim::scene::{JointMotion, SceneBody, SceneJoint, SceneModel, SceneShape};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Heights of handles that the arm gets at with its hand level, metres.
const HANDLE_M: (f64, f64) = (0.3, 1.15);
/// The floor before a handle must be free between these distances, metres: to stand there, to unfold the arm and to back off.
const FLOOR_M: [f64; 4] = [0.6, 0.75, 0.9, 1.05];
/// Room towards the hinge that it takes to swing a door, metres.
const ASIDE_M: f64 = 0.3;
/// Doors that are to be closed stand open by so much, radians.
const DOOR_RAD: (f64, f64) = (0.4, 1.0);
/// Handles of one height differ by less, metres.
const ROW_M: f64 = 0.05;

/// A drawer or a door.
#[derive(Clone, Debug)]
pub(super) struct HomePart {
    pub body: String,
    /// The furniture, among the objects of the home.
    pub whole: usize,
    pub slides: bool,
    /// Middle of the handle.
    pub handle: Point3<f64>,
    /// Out of the front.
    pub normal: Vector3<f64>,
    /// Things inside, among the objects of the home.
    pub contents: Vec<usize>,
    /// A point on the hinge of a door.
    pub hinge: Option<Point3<f64>>,
    /// All its way, metres or radians.
    pub way: f64,
}

/// The parts of a home's furniture as they stand.
pub(super) fn find_parts(home: &Home, model: &SceneModel) -> Vec<HomePart> {
    model.joints.iter().filter_map(|joint| part_of(home, model, joint)).collect()
}

fn part_of(home: &Home, model: &SceneModel, joint: &SceneJoint) -> Option<HomePart> {
    let (part, carrier) = (&model.bodies[joint.part], &model.bodies[joint.carrier]);
    let whole = home.objects.iter().position(|object| object.body == carrier.name)?;
    // The front is the upright board with the largest face; it faces away from the furniture.
    let (front, half) = part
        .geoms
        .iter()
        .filter_map(|geom| match &geom.shape {
            SceneShape::Box { half_m } => Some((part.world_from_body * geom.body_from_geom, *half_m)),
            _ => None,
        })
        .filter(|(pose, half)| (pose.rotation * Vector3::ith(half.imin(), 1.0)).z.abs() < 0.5)
        .max_by(|a, b| face_m2(&a.1).total_cmp(&face_m2(&b.1)))?;
    let axis = front.rotation * Vector3::ith(half.imin(), 1.0);
    let middle = middle_of(carrier);
    let out = front.translation.vector - middle.coords;
    let normal = Vector3::new(axis.x, axis.y, 0.0).try_normalize(0.5)?;
    let normal = if normal.dot(&out) < 0.0 { -normal } else { normal };
    // What stands out farthest is the handle.
    let centers =
        part.geoms.iter().map(|geom| Point3::from((part.world_from_body * geom.body_from_geom).translation.vector));
    let handle = centers.max_by(|a, b| a.coords.dot(&normal).total_cmp(&b.coords.dot(&normal)))?;
    let slides = joint.motion == JointMotion::Slide;
    let at = (part.world_from_body * joint.part_from_joint).translation.vector;
    let hinge = (!slides).then_some(Point3::from(at));
    let contents =
        (0..home.objects.len()).filter(|i| home.objects[*i].free && holds(part, &home.objects[*i].at)).collect();
    let way = joint.range.map_or(0.0, |[low, high]| high - low);
    Some(HomePart { body: part.name.clone(), whole, slides, handle, normal, contents, hinge, way })
}

/// Whether a point lies within the box around a body.
fn holds(body: &SceneBody, point: &Point3<f64>) -> bool {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for geom in &body.geoms {
        let SceneShape::Box { half_m } = &geom.shape else { continue };
        let half = geom.body_from_geom.rotation.to_rotation_matrix().matrix().abs() * half_m;
        let at = geom.body_from_geom.translation.vector;
        (low, high) = (low.inf(&(at - half)), high.sup(&(at + half)));
    }
    let point = body.world_from_body.inverse_transform_point(point).coords;
    (0..3).all(|k| point[k] > low[k] && point[k] < high[k])
}

fn face_m2(half: &Vector3<f64>) -> f64 {
    half.x * half.y * half.z / half.min().max(1e-6)
}

fn middle_of(body: &SceneBody) -> Point3<f64> {
    let mut low = Point3::from(body.world_from_body.translation.vector);
    let mut high = low;
    for geom in &body.geoms {
        let at = Point3::from((body.world_from_body * geom.body_from_geom).translation.vector);
        (low, high) = (low.inf(&at), high.sup(&at));
    }
    nalgebra::center(&low, &high)
}

/// What tells a part from the others of its kind in the same furniture: nothing when it is the only one; `None` when nobody
/// would know which is meant.
fn find_place(part: &HomePart, parts: &[HomePart]) -> Option<&'static str> {
    let of_kind: Vec<&HomePart> =
        parts.iter().filter(|other| other.whole == part.whole && other.slides == part.slides).collect();
    let count = of_kind.len();
    if count == 1 {
        return Some("");
    }
    let right = Vector3::z().cross(&part.normal);
    let is_row = of_kind.iter().all(|other| (other.handle.z - part.handle.z).abs() < ROW_M);
    if is_row && count == 2 {
        let other = of_kind.iter().find(|other| other.body != part.body)?;
        let is_right = (part.handle - other.handle).dot(&right) > 0.0;
        return Some(if is_right { "right " } else { "left " });
    }
    let above = of_kind.iter().filter(|other| other.handle.z > part.handle.z + ROW_M).count();
    let below = of_kind.iter().filter(|other| other.handle.z < part.handle.z - ROW_M).count();
    // One above the other, each in a row of its own.
    if above + below + 1 != count {
        return None;
    }
    match (above, below) {
        (0, _) => Some("top "),
        (_, 0) => Some("bottom "),
        (1, 1) => Some("middle "),
        (1, _) => Some("second "),
        (2, _) => Some("third "),
        _ => None,
    }
}

/// Parts that the robot can come to.
fn within_reach<'a>(home: &Home, parts: &'a [HomePart], stands: &Stands) -> Vec<&'a HomePart> {
    let reachable = |part: &&HomePart| {
        let room = home.objects[part.whole].room.as_deref();
        // A door is swung from a stand towards its hinge.
        let aside = part.hinge.map_or(Vector3::zeros(), |hinge| {
            let across = Vector3::z().cross(&part.normal);
            across * (ASIDE_M * (hinge - part.handle).dot(&across).signum())
        });
        let free = |out_m: &f64| {
            [Vector3::zeros(), aside].iter().all(|by| stands.has(&(part.handle + part.normal * *out_m + by).xy(), room))
        };
        (HANDLE_M.0..=HANDLE_M.1).contains(&part.handle.z) && FLOOR_M.iter().all(free)
    };
    parts.iter().filter(reachable).collect()
}

/// A drawer (`slides`) or door that was not used yet, to be opened.
pub(super) fn find_opening(
    slides: bool,
    home: &Home,
    parts: &[HomePart],
    stands: &Stands,
    knowledge: &Knowledge,
    used: &mut Vec<String>,
    rng: &mut ChaCha8Rng,
) -> Option<Task> {
    let mut candidates = within_reach(home, parts, stands);
    candidates.retain(|part| part.slides == slides && !used.contains(&part.body));
    candidates.shuffle(rng);
    candidates.into_iter().find_map(|part| {
        let place = find_place(part, parts)?;
        let names = find_names(part.whole, home, knowledge);
        let name = names.get(rng.random_range(0..names.len().max(1)))?;
        used.push(part.body.clone());
        let whole = &home.objects[part.whole].body;
        let verbs = if slides { ["Open", "Pull out"] } else { ["Open", "Pull open"] };
        let verb = verbs[rng.random_range(0..2)];
        let noun = if slides { "drawer" } else { "door" };
        Some(Task {
            body: None,
            disturbance: String::new(),
            start: String::new(),
            kind: if slides { "open_drawer" } else { "open_door" },
            why: format!("It is {}.", part.body),
            command: format!("{verb} the {place}{noun} of the {name}"),
            expect: format!("kind = \"joint_open\"\nobject = \"{whole}\"\npart = \"{}\"", part.body),
            time_limit_s: OPEN_LIMIT_S,
            explores_first: false,
        })
    })
}

/// A drawer (`slides`) or door that was not used yet and stands open at the start, to be closed.
pub(super) fn find_closing(
    slides: bool,
    home: &Home,
    parts: &[HomePart],
    stands: &Stands,
    knowledge: &Knowledge,
    used: &mut Vec<String>,
    rng: &mut ChaCha8Rng,
) -> Option<Task> {
    let mut candidates = within_reach(home, parts, stands);
    candidates.retain(|part| part.slides == slides && part.way > 0.0 && !used.contains(&part.body));
    candidates.shuffle(rng);
    candidates.into_iter().find_map(|part| {
        let place = find_place(part, parts)?;
        let names = find_names(part.whole, home, knowledge);
        let name = names.get(rng.random_range(0..names.len().max(1)))?;
        let share =
            if slides { rng.random_range(0.5..=1.0) } else { rng.random_range(DOOR_RAD.0..=DOOR_RAD.1) / part.way };
        let room = home.objects[part.whole].room.as_deref();
        let is_free = |place: &Point2<f64>| stands.has(place, room);
        if !places_to_push(part, share * part.way).iter().all(is_free) {
            return None;
        }
        used.push(part.body.clone());
        let whole = &home.objects[part.whole].body;
        let verb = ["Close", "Shut"][rng.random_range(0..2)];
        let noun = if slides { "drawer" } else { "door" };
        Some(Task {
            body: None,
            disturbance: String::new(),
            start: format!("\n[[open]]\npart = \"{}\"\nshare = {share:.2}\n", part.body),
            kind: if slides { "close_drawer" } else { "close_door" },
            why: format!("It is {}.", part.body),
            command: format!("{verb} the {place}{noun} of the {name}"),
            expect: format!("kind = \"joint_closed\"\nobject = \"{whole}\"\npart = \"{}\"", part.body),
            time_limit_s: OPEN_LIMIT_S,
            explores_first: false,
        })
    })
}

/// Where the base must be able to stand to push a part that is open by so much, metres or radians, to its end.
fn places_to_push(part: &HomePart, open_by: f64) -> Vec<Point2<f64>> {
    let Some(hinge) = part.hinge else {
        return FLOOR_M.iter().map(|away_m| (part.handle + part.normal * (open_by + away_m)).xy()).collect();
    };
    // Where the handle is goes about the hinge; what pushes it goes the straight way from there to its end.
    let across = Vector3::z().cross(&part.normal);
    let sense = (hinge - part.handle).dot(&across).signum();
    let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sense * open_by);
    let open = hinge + turned * (part.handle - hinge);
    let way = (part.handle - open).xy().normalize();
    FLOOR_M.iter().map(|away_m| open.xy() - way * *away_m).collect()
}

/// A thing in a drawer that was not used yet, to be taken out; the only one of its kind there.
pub(super) fn find_fetching(
    home: &Home,
    parts: &[HomePart],
    stands: &Stands,
    knowledge: &Knowledge,
    used: &mut Vec<String>,
    rng: &mut ChaCha8Rng,
) -> Option<Task> {
    let mut candidates: Vec<(&HomePart, usize)> = within_reach(home, parts, stands)
        .into_iter()
        .filter(|part| part.slides)
        .flat_map(|part| part.contents.iter().map(move |thing| (part, *thing)))
        .filter(|(_, thing)| !used.contains(&home.objects[*thing].body))
        .collect();
    candidates.shuffle(rng);
    candidates.into_iter().find_map(|(part, thing)| {
        let object = &home.objects[thing];
        let noun = object.category.as_str();
        let alone = part.contents.iter().filter(|other| home.is_called(**other, noun, knowledge)).count() == 1;
        let place = find_place(part, parts).filter(|_| alone)?;
        let names = find_names(part.whole, home, knowledge);
        let name = names.get(rng.random_range(0..names.len().max(1)))?;
        used.push(object.body.clone());
        let verb = ["Take", "Get"][rng.random_range(0..2)];
        Some(Task {
            body: None,
            disturbance: String::new(),
            start: String::new(),
            kind: "fetch_inside",
            why: format!("It lies in {}.", part.body),
            command: format!("{verb} the {noun} out of the {place}drawer of the {name}"),
            expect: format!("kind = \"object_lifted\"\nobject = \"{}\"", object.body),
            time_limit_s: OPEN_LIMIT_S,
            explores_first: false,
        })
    })
}
