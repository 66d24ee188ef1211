//! Contract of map construction: one object per thing, in its place, with its relations, gone when it is gone; free space
//! and rooms as they are; the same bytes for the same input.

mod world;

use dsm::geometry::Aabb;
use dsm::map::{AttributeKind, CellState, RelationKind};
use nalgebra::{Point2, Vector3};
use world::{Noise, Session, World};

const RED: [u8; 3] = [200, 40, 40];
const WOOD: [u8; 3] = [160, 110, 70];

fn noise(position_m: f64, seed: u64) -> Noise {
    Noise { position_m, depth: true, seed, ..Noise::default() }
}

fn box_iou(found: &dsm::map::MapObject, truth: &Aabb) -> f64 {
    found.bounds.iou(&(*truth).into())
}

fn table_with_mugs() -> World {
    World::default()
        .with_room([-3.0, -3.0], [3.0, 3.0])
        .with("dining table", [0.0, 0.0, 0.375], [1.2, 0.8, 0.75], WOOD)
        .with("mug", [-0.06, -0.2, 0.80], [0.08, 0.08, 0.10], RED)
        .with("mug", [0.06, -0.2, 0.80], [0.08, 0.08, 0.10], RED)
}

#[test]
fn two_equal_mugs_side_by_side_stay_two_and_stand_on_the_table() {
    for noise in [Noise::default(), noise(0.03, 7)] {
        let world = table_with_mugs();
        let mut session = Session::new(noise);
        session.circle(&world, [0.0, 0.0, 0.7], 1.7, 1.25, 24);
        let mugs: Vec<_> = session.named("mug").iter().map(|m| m.id).collect();
        let tables: Vec<_> = session.named("dining table").iter().map(|t| t.id).collect();
        assert_eq!((mugs.len(), tables.len()), (2, 1), "{noise:?}");
        let has = |from, kind, to| session.map.relations.iter().any(|r| r.from == from && r.kind == kind && r.to == to);
        for mug in &mugs {
            assert!(has(*mug, RelationKind::On, tables[0]), "{noise:?}: {:?}", session.map.relations);
            assert!(has(tables[0], RelationKind::Under, *mug));
        }
        assert!(has(mugs[0], RelationKind::NextTo, mugs[1]) && has(mugs[1], RelationKind::NextTo, mugs[0]));
        let red = session.named("mug")[0].attributes.find(AttributeKind::Appearance, "color").map(str::to_owned);
        assert_eq!(red.as_deref(), Some("red"));
    }
}

#[test]
fn a_thing_seen_from_all_sides_is_one_object_with_a_tight_box() {
    for (noise, least) in [(Noise::default(), 0.8), (noise(0.02, 3), 0.7)] {
        let world = World::default().with_room([-3.0, -3.0], [3.0, 3.0]).with(
            "cabinet",
            [0.2, -0.1, 0.45],
            [0.8, 0.5, 0.9],
            WOOD,
        );
        let mut session = Session::new(noise);
        session.circle(&world, [0.2, -0.1, 0.5], 2.0, 1.25, 24);
        assert_eq!(session.map.objects.len(), 1);
        let iou = box_iou(session.named("cabinet")[0], &world.blocks[4].bounds);
        assert!(iou > least, "{noise:?}: {iou} {:?}", session.named("cabinet")[0].bounds);
    }
}

#[test]
fn a_removed_thing_leaves_the_map_and_a_hidden_one_stays() {
    let mut world = table_with_mugs();
    let mut session = Session::new(noise(0.01, 5));
    let (eye, target) = ([1.6, -1.0, 1.25], [0.0, -0.1, 0.7]);
    (0..8).for_each(|_| session.see(&world, eye, target));
    assert_eq!(session.named("mug").len(), 2);
    // Something steps between camera and table.
    let clear = world.clone();
    world = world.with_wall([1.0, -0.65, 0.6], [0.1, 1.6, 1.2]);
    (0..10).for_each(|_| session.see(&world, eye, target));
    assert_eq!(session.named("mug").len(), 2, "hidden is not absent");
    // One mug is taken away.
    world = clear;
    world.blocks.retain(|b| b.name != Some("mug") || b.bounds.center().x < 0.0);
    (0..10).for_each(|_| session.see(&world, eye, target));
    assert_eq!(session.named("mug").len(), 1, "gone within 2 s");
    assert!(session.named("mug")[0].bounds.center.x < 0.0);
}

#[test]
fn looking_over_a_table_does_not_free_it() {
    let world = table_with_mugs();
    let mut session = Session::new(noise(0.01, 1));
    session.circle(&world, [0.0, 0.0, 0.4], 2.0, 1.25, 30);
    let free = &session.map.free_space;
    assert_eq!(free.state_at(&Point2::new(0.3, 0.1)), CellState::Occupied);
    assert_eq!(free.state_at(&Point2::new(1.2, 0.0)), CellState::Free);
    assert_eq!(free.state_at(&Point2::new(8.0, 0.0)), CellState::Unknown);
    let occupied = free.known_cells().filter(|(cell, state)| {
        let p = free.center_of(*cell);
        *state == CellState::Occupied && p.x.abs() < 2.8 && p.y.abs() < 2.8 && (p.x.abs() > 0.7 || p.y.abs() > 0.5)
    });
    assert!(occupied.count() <= 3, "free floor is not occupied");
}

fn two_rooms() -> World {
    World::default()
        .with_room([0.0, 0.0], [8.0, 4.0])
        .with_wall([4.0, 0.775, 1.25], [0.1, 1.55, 2.5])
        .with_wall([4.0, 3.225, 1.25], [0.1, 1.55, 2.5])
        .with("bed", [1.2, 3.2, 0.25], [2.0, 1.5, 0.5], [60, 80, 190])
        .with("stove", [7.5, 0.5, 0.45], [0.6, 0.6, 0.9], [220, 220, 220])
        .with("fridge", [7.6, 3.5, 0.9], [0.65, 0.65, 1.8], [235, 235, 235])
}

#[test]
fn rooms_joined_by_a_door_are_two_and_named_by_what_they_hold() {
    let world = two_rooms();
    let mut session = Session::new(noise(0.01, 2));
    for center in [2.0, 3.4, 4.0, 4.6, 6.0] {
        for i in 0..16 {
            let angle = std::f64::consts::TAU * f64::from(i) / 16.0;
            session.see(&world, [center, 2.0, 1.25], [center + angle.cos(), 2.0 + angle.sin(), 0.95]);
        }
    }
    let mut names: Vec<_> = session.map.rooms.iter().map(|room| room.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["bedroom", "kitchen"], "{:?}", session.map.rooms);
    let rooms = &session.map.rooms;
    assert_eq!(
        (rooms[0].neighbours.as_slice(), rooms[1].neighbours.as_slice()),
        ([rooms[1].id].as_slice(), [rooms[0].id].as_slice())
    );
    assert!(rooms.iter().all(|room| (12.0..18.0).contains(&room.area_m2)), "{rooms:?}");
    let bed = session.named("bed")[0];
    assert_eq!(session.map.find_room(bed.room.unwrap()).unwrap().name, "bedroom");
}

#[test]
fn same_input_gives_the_same_bytes() {
    let run = || {
        let world = table_with_mugs();
        let mut session = Session::new(noise(0.03, 11));
        session.circle(&world, [0.0, 0.0, 0.7], 1.8, 1.25, 10);
        postcard::to_stdvec(&session.map).unwrap()
    };
    let first = run();
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(run);
    assert!(first == single, "thread count must not matter");
}

#[test]
fn a_loaded_map_is_taken_up_instead_of_doubled() {
    let world = table_with_mugs();
    let mut session = Session::new(noise(0.01, 4));
    session.circle(&world, [0.0, 0.0, 0.7], 1.7, 1.25, 12);
    let mut again = Session::new(session.noise);
    again.map = session.map.clone();
    again.frames = session.frames;
    again.circle(&world, [0.0, 0.0, 0.7], 1.7, 1.25, 12);
    assert_eq!(again.named("mug").len(), 2);
    assert_eq!(again.named("dining table").len(), 1);
}

#[test]
fn what_wanders_about_the_truth_ends_near_it() {
    let slow = Noise { position_m: 0.04, attitude_rad: 0.003, depth: true, seed: 2, ..Noise::default() };
    let world = table_with_mugs();
    let far_off_m = |rounds: usize| {
        let mut session = Session::new(slow);
        (0..rounds).for_each(|_| session.circle(&world, [0.0, 0.0, 0.7], 1.7, 1.25, 24));
        let off = |o: &&dsm::map::MapObject| (o.bounds.center.xy() - truth(&world, o)).norm();
        let objects: Vec<_> = session.map.objects.values().map(|o| &**o).collect();
        assert_eq!(objects.len(), 3);
        objects.iter().map(off).fold(0.0, f64::max)
    };
    let (first, last) = (far_off_m(1), far_off_m(6));
    assert!(first > 0.02 && last < 0.5 * first, "{first} {last}");
}

/// Middle of the nearest thing of the world, seen from above.
fn truth(world: &World, object: &dsm::map::MapObject) -> Point2<f64> {
    let centers = world.blocks.iter().map(|block| block.bounds.center());
    let off = |c: &nalgebra::Point3<f64>| (c - object.bounds.center).norm();
    centers.min_by(|a, b| off(a).total_cmp(&off(b))).expect("a world has walls").xy()
}

#[test]
fn hostile_frames_change_nothing_and_do_not_panic() {
    let mut session = Session::new(Noise::default());
    let (mut frame, mut detections) = table_with_mugs().render(
        world::camera_model(),
        0,
        0.0,
        world::look_at([1.7, 0.0, 1.2], [0.0, 0.0, 0.7]),
        Noise::default(),
    );
    frame.depth_m.iter_mut().step_by(3).for_each(|d| *d = f32::NAN);
    for detection in &mut detections.items {
        detection.mask.runs.push(dsm::perceive::Run { start: u32::MAX - 9, length: 5 });
    }
    let carrier = dsm::build::Carrier::default();
    let update = session.builder.observe(&session.map, &frame, &detections, &carrier);
    session.map.apply(update);
    assert!(
        session.map.objects.values().all(|o| o.points.iter().all(|p| p.position.coords.iter().all(|c| c.is_finite())))
    );
    frame.depth_m.pop();
    assert!(session.builder.observe(&session.map, &frame, &detections, &carrier).changes.is_empty());
}

fn home() -> World {
    let white = [228, 228, 225];
    World::default()
        .with_room([0.0, 0.0], [8.0, 4.0])
        .with_wall([4.0, 0.775, 1.25], [0.1, 1.55, 2.5])
        .with_wall([4.0, 3.225, 1.25], [0.1, 1.55, 2.5])
        .with("bed", [1.2, 3.2, 0.25], [2.0, 1.5, 0.5], [60, 80, 190])
        .with("wardrobe", [0.3, 0.8, 0.95], [0.6, 1.2, 1.9], [120, 80, 50])
        .with("desk", [3.2, 0.4, 0.37], [1.2, 0.6, 0.74], WOOD)
        .with("laptop", [3.2, 0.4, 0.77], [0.33, 0.23, 0.06], [60, 60, 65])
        .with("mug", [2.8, 0.45, 0.79], [0.08, 0.08, 0.10], RED)
        .with("book", [3.65, 0.35, 0.76], [0.15, 0.22, 0.04], [30, 120, 60])
        .with("pillow", [0.5, 3.0, 0.56], [0.4, 0.6, 0.12], white)
        .with("pillow", [0.5, 3.65, 0.56], [0.4, 0.6, 0.12], white)
        .with("stove", [7.7, 0.4, 0.45], [0.6, 0.6, 0.9], white)
        .with("cabinet", [7.0, 0.35, 0.45], [0.75, 0.6, 0.9], [200, 190, 170])
        .with("cabinet", [6.2, 0.35, 0.45], [0.8, 0.6, 0.9], [200, 190, 170])
        .with("bowl", [6.9, 0.35, 0.94], [0.16, 0.16, 0.08], [230, 200, 40])
        .with("bottle", [6.5, 0.3, 1.03], [0.08, 0.08, 0.26], [30, 140, 60])
        .with("mug", [6.1, 0.4, 0.95], [0.08, 0.08, 0.10], [40, 80, 200])
        .with("mug", [6.25, 0.4, 0.95], [0.08, 0.08, 0.10], [40, 80, 200])
        .with("fridge", [7.6, 3.5, 0.9], [0.65, 0.65, 1.8], [235, 235, 235])
        .with("dining table", [5.7, 2.8, 0.375], [1.2, 0.8, 0.75], WOOD)
        .with("chair", [5.3, 2.1, 0.42], [0.42, 0.42, 0.84], [150, 60, 40])
        .with("chair", [5.3, 3.5, 0.42], [0.42, 0.42, 0.84], [150, 60, 40])
        .with("plate", [5.5, 2.8, 0.765], [0.24, 0.24, 0.03], white)
        .with("apple", [6.0, 2.9, 0.785], [0.07, 0.07, 0.07], RED)
}

/// A tour through both rooms, looking all around from eight places.
fn tour(session: &mut Session, world: &World) {
    for [x, y] in [[2.0, 2.0], [1.4, 1.5], [2.8, 1.6], [3.4, 2.0], [4.0, 2.0], [4.6, 2.0], [6.7, 1.5], [6.9, 2.3]] {
        for i in 0..18 {
            let angle = std::f64::consts::TAU * f64::from(i) / 18.0;
            session.see(world, [x, y, 1.25], [x + angle.cos(), y + angle.sin(), 0.9]);
        }
    }
}

/// Objects found, duplicates, ghosts and mean IoU of the found ones, against truth.
fn score(session: &Session, world: &World) -> (usize, usize, usize, f64) {
    let truths: Vec<_> = world.blocks.iter().filter(|b| b.name.is_some()).collect();
    let mut taken = vec![0usize; truths.len()];
    let (mut ghosts, mut sum) = (0, 0.0);
    for object in session.map.stable_objects() {
        let best = (0..truths.len())
            .map(|i| (box_iou(object, &truths[i].bounds), i))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(iou, i)| *iou > 0.1 || truths[*i].bounds.contains(&object.bounds.center));
        match best {
            Some((iou, i)) => {
                taken[i] += 1;
                sum += iou;
            }
            None => ghosts += 1,
        }
    }
    let found = taken.iter().filter(|n| **n > 0).count();
    (found, taken.iter().map(|n| n.saturating_sub(1)).sum(), ghosts, sum / taken.iter().sum::<usize>().max(1) as f64)
}

#[test]
fn a_noisy_tour_finds_everything_once_with_its_relations_and_colours() {
    let world = home();
    for (position_m, least_iou) in [(0.01, 0.66), (0.03, 0.60)] {
        let noise = Noise { position_m, attitude_rad: position_m * 0.3, depth: true, detector: true, seed: 9 };
        let mut session = Session::new(noise);
        tour(&mut session, &world);
        let (found, duplicates, ghosts, iou) = score(&session, &world);
        assert_eq!((found, duplicates, ghosts), (21, 0, 0), "{position_m} m, mean IoU {iou:.3}");
        assert!(iou > least_iou, "{position_m} m: mean IoU {iou:.3}");
        let rests = |upper: &str, lower: &str| {
            let uppers = session.named(upper);
            let on_lower = |id| {
                session.map.relations.iter().any(|r| {
                    r.from == id
                        && r.kind == RelationKind::On
                        && session.map.find_object(r.to).is_some_and(|o| o.name() == lower)
                })
            };
            uppers.iter().filter(|o| on_lower(o.id)).count()
        };
        let resting =
            [("laptop", "desk"), ("book", "desk"), ("bowl", "cabinet"), ("plate", "dining table"), ("pillow", "bed")]
                .map(|(upper, lower)| rests(upper, lower));
        assert_eq!(resting, [1, 1, 1, 1, 2], "{position_m} m");
        assert_eq!((rests("mug", "cabinet"), rests("mug", "desk"), rests("chair", "dining table")), (2, 1, 0));
        let color =
            |name: &str| session.named(name)[0].attributes.find(AttributeKind::Appearance, "color").map(str::to_owned);
        let colors =
            ["apple", "bed", "book", "bowl", "bottle", "dining table", "plate"].map(|name| color(name).unwrap());
        assert_eq!(colors, ["red", "blue", "green", "yellow", "green", "brown", "white"]);
    }
}

#[test]
fn what_carries_the_camera_stays_out_of_the_map() {
    let world = table_with_mugs().with("mug", [0.9, 0.0, 1.0], [0.1, 0.1, 0.1], RED);
    let arm = dsm::geometry::OrientedBox::from(world.blocks.last().unwrap().bounds.grown(0.02));
    let carrier =
        dsm::build::Carrier { bodies: vec![arm], footprint: Some((Point2::new(1.7, 0.0), 0.3)), ..Default::default() };
    let mut session = Session::new(Noise::default());
    for i in 0..5 {
        let pose = world::look_at([1.7, 0.0, 1.25], [0.0, 0.0, 0.7]);
        let (frame, detections) = world.render(world::camera_model(), i, i as f64 * 0.2, pose, Noise::default());
        let update = session.builder.observe(&session.map, &frame, &detections, &carrier);
        session.map.apply(update);
    }
    let mugs = session.named("mug");
    assert!(!mugs.is_empty() && mugs.iter().all(|mug| mug.bounds.center.x < 0.5), "one is held by the carrier");
    assert_eq!(session.map.free_space.state_at(&Point2::new(1.7, 0.0)), CellState::Free);
    assert_ne!(session.map.free_space.state_at(&Point2::new(0.9, 0.0)), CellState::Occupied);
}

#[test]
fn what_was_pushed_in_with_a_drawer_stays_in_the_map_inside() {
    // A mug in an open drawer before the cabinet, then the drawer is pushed in and nobody sees the mug any more.
    let cabinet =
        World::default().with_room([-3.0, -3.0], [3.0, 3.0]).with("cabinet", [0.0, 0.0, 0.4], [0.9, 0.6, 0.8], WOOD);
    let open = cabinet.clone().with("mug", [0.0, -0.5, 0.5], [0.08, 0.08, 0.1], RED);
    let mut session = Session::new(Noise::default());
    session.circle(&open, [0.0, -0.2, 0.5], 1.7, 1.25, 24);
    let (mug, whole) = (session.named("mug")[0].id, session.named("cabinet")[0].id);
    session.moved = vec![(mug, Vector3::new(0.0, 0.45, 0.0))];
    session.circle(&cabinet, [0.0, -0.2, 0.5], 1.7, 1.25, 24);
    let found = session.map.find_object(mug).expect("it cannot be seen, which is not to be gone");
    assert!((found.bounds.center.y + 0.05).abs() < 0.05, "{:?}", found.bounds);
    let inside = |r: &&dsm::map::Relation| r.from == mug && r.to == whole && r.kind == RelationKind::Inside;
    assert!(session.map.relations.iter().any(|r| inside(&r)), "{:?}", session.map.relations);
}
