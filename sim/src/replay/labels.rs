//! The surface of a scene that shows from where a robot can stand, with its labels: for the evaluator alone.

use super::sightings::Sightings;
use crate::camera::{CameraRig, LightDraw, TrueImage};
use crate::scene::{SceneModel, Semantics, scene_file};
use crate::world::{Solids, WorldConfig, WorldError, free_space, settle};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::eval::{LabelClasses, LabelledCloud, TrueScene};
use dsm::map::{CellState, FreeSpace};
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// Distance between the places that are looked from, metres.
const APART_M: f64 = 1.0;
/// Free floor around such a place, metres.
const RADIUS_M: f64 = 0.25;
/// Height of the eye, and the height up to which the floor below must be free, metres.
const EYE_M: f64 = 1.25;
/// Directions that are looked in.
const TURNS: usize = 6;
/// Vertical field of view, radians.
const VIEW_RAD: f64 = 1.2;
/// Downward looks, radians.
const TILTS_RAD: [f64; 2] = [0.1, 0.7];

/// The visible surface of a scene (its file or folder) with the placements of a seed, and what its labels mean: one class
/// for each category. Walls, floors and doors are left out.
///
/// # Errors
/// [`WorldError`]: whatever is wrong with the scene or its semantics.
pub fn label_surfaces(scene: &Path, seed: u64) -> Result<(LabelledCloud, LabelClasses), WorldError> {
    let mut model = SceneModel::load(scene)?;
    let semantics = Semantics::load(&scene_file(scene), &model)?;
    let solids = Solids::new(&model)?;
    settle(&mut model, &semantics, &solids, &WorldConfig { seed, ..WorldConfig::default() })?;
    let bodies: Vec<Pose> = model.bodies.iter().map(|body| body.world_from_body).collect();
    let wholes = semantics.find_wholes(&model);
    let mut rig = CameraRig::new(&model, &[], &LightDraw::unchanged())?.showing(&model, &wholes);
    let mut sightings = Sightings::new(&model, &semantics, &rig);
    let camera = CameraModel::from_vertical_fov(320, 240, VIEW_RAD);
    let mut image = TrueImage::default();
    for place in find_places(&free_space(&model, &solids, EYE_M)) {
        for (turn, tilt) in (0..TURNS).flat_map(|turn| TILTS_RAD.map(|tilt| (turn, tilt))) {
            let yaw = turn as f64 / TURNS as f64 * std::f64::consts::TAU;
            let pose = look(&place, yaw, tilt);
            rig.render_into(&bodies, &[], &camera, &pose, &mut image);
            sightings.note(&image, &camera, &pose, &bodies);
        }
    }
    let seen = TrueScene { name: model.name.clone(), rooms: Vec::new(), objects: sightings.into_objects(&bodies) };
    Ok(seen.to_labelled())
}

/// Places on a grid with free floor around them.
fn find_places(free: &FreeSpace) -> Vec<Point2<f64>> {
    let step = (APART_M / free.resolution_m) as i32;
    let reach = (RADIUS_M / free.resolution_m) as i32;
    let is_free = |cell: [i32; 2]| {
        (-reach..=reach)
            .all(|dy| (-reach..=reach).all(|dx| free.state([cell[0] + dx, cell[1] + dy]) == CellState::Free))
    };
    let on_grid = |cell: &[i32; 2]| cell.iter().all(|c| c.rem_euclid(step) == step / 2);
    let cells = free.known_cells().map(|(cell, _)| cell).filter(on_grid);
    cells.filter(|cell| is_free(*cell)).map(|cell| free.center_of(cell)).collect()
}

/// A camera above a place that looks along a yaw, tilted down.
fn look(place: &Point2<f64>, yaw_rad: f64, tilt_rad: f64) -> Pose {
    let (sin, cos) = yaw_rad.sin_cos();
    let z = Vector3::new(cos * tilt_rad.cos(), sin * tilt_rad.cos(), -tilt_rad.sin());
    let x = Vector3::new(sin, -cos, 0.0);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    let eye = Point3::new(place.x, place.y, EYE_M);
    Isometry3::from_parts(Translation3::from(eye.coords), UnitQuaternion::from_rotation_matrix(&rotation))
}

#[cfg(test)]
mod tests {
    //! Contract: places are free all around; a camera looks where it is told.
    use super::*;

    #[test]
    fn places_are_free_and_cameras_look_ahead() {
        let mut free = FreeSpace::new(0.05);
        for (column, row) in (0..60).flat_map(|x| (0..60).map(move |y| (x, y))) {
            free.set([column, row], CellState::Free);
        }
        free.set([11, 11], CellState::Occupied);
        let places = find_places(&free);
        assert_eq!(places.len(), 8, "the one beside the obstacle is left out: {places:?}");
        let pose = look(&places[0], std::f64::consts::FRAC_PI_2, 0.0);
        assert!((pose * Vector3::z() - Vector3::y()).norm() < 1e-9, "forward");
        assert!((pose * Vector3::y() + Vector3::z()).norm() < 1e-9, "down");
        let down = look(&places[0], 0.0, 0.5) * Vector3::z();
        assert!((down.z + 0.5_f64.sin()).abs() < 1e-9 && down.x > 0.0);
    }
}
