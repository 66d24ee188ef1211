//! Bodies that a scene does not have: the box that somebody leaves in the way, and the person.

use crate::scene::{BodyMotion, SceneBody, SceneGeom, SceneMaterial, SceneModel, SceneShape};
use dsm::Pose;
use nalgebra::Vector3;

/// Half the sides of the box, metres: a removal box on end.
pub(super) const BOX_HALF_M: [f64; 3] = [0.17, 0.17, 0.4];
/// Radius and height of the person, metres: shoulders are 0.44 m wide.
pub(super) const PERSON_M: (f64, f64) = (0.22, 1.7);
/// Where bodies are that are not in the world: below everything, beyond every camera.
pub(super) const NOWHERE_M: f64 = -200.0;

/// Adds a box to the scene, out of the world; its index.
pub(super) fn add_box(scene: &mut SceneModel, number: usize) -> usize {
    let [x, y, z] = BOX_HALF_M;
    let shape = SceneShape::Box { half_m: Vector3::new(x, y, z) };
    let geoms = vec![(shape, Pose::translation(0.0, 0.0, z))];
    add(scene, format!("disturb/box_{number}"), [0.55, 0.42, 0.28, 1.0], geoms)
}

/// Adds a person to the scene, out of the world; its index.
pub(super) fn add_person(scene: &mut SceneModel, number: usize) -> usize {
    const HEAD_M: f64 = 0.12;
    let (radius_m, height_m) = PERSON_M;
    let half_length_m = 0.5 * (height_m - 2.0 * HEAD_M);
    let body = SceneShape::Cylinder { radius_m, half_length_m };
    let head = SceneShape::Sphere { radius_m: HEAD_M };
    let geoms = vec![
        (body, Pose::translation(0.0, 0.0, half_length_m)),
        (head, Pose::translation(0.0, 0.0, height_m - HEAD_M)),
    ];
    add(scene, format!("disturb/person_{number}"), [0.2, 0.25, 0.45, 1.0], geoms)
}

fn add(scene: &mut SceneModel, name: String, rgba: [f32; 4], geoms: Vec<(SceneShape, Pose)>) -> usize {
    const FRICTION: f64 = 0.5;
    scene.materials.push(SceneMaterial {
        name: name.clone(),
        rgba,
        texture: None,
        texture_repeat: [1.0, 1.0],
        texture_span: Default::default(),
        specular: 0.1,
        shininess: 0.1,
        metallic: 0.0,
        emission: 0.0,
    });
    let material = scene.materials.len() - 1;
    let geom = |(shape, body_from_geom)| SceneGeom {
        name: None,
        body_from_geom,
        shape,
        material,
        friction: FRICTION,
        collides: true,
        kinds: 1,
        touches: 1,
        visible: true,
    };
    scene.bodies.push(SceneBody {
        name,
        world_from_body: Pose::translation(0.0, 0.0, NOWHERE_M),
        motion: BodyMotion::Fixed,
        mass_kg: 0.0,
        spread: None,
        geoms: geoms.into_iter().map(geom).collect(),
    });
    scene.bodies.len() - 1
}
