//! A scene as MuJoCo sees it: drawn by its own OpenGL renderer, and along its own rays.
#![allow(unsafe_code, reason = "MuJoCo draws into an OpenGL context that only the caller can vouch for")]

use crate::compose::{add_scene_meshes, refused, set_shape, wxyz};
use crate::egl::GlContext;
use crate::messages::route_messages;
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm_sim::camera::{VISIBLE_ALPHA, label_of_body};
use dsm_sim::physics::PhysicsError;
use dsm_sim::scene::{SceneModel, SceneShape};
use mujoco_rs::mujoco_c::mjtRndFlag;
use mujoco_rs::prelude::{
    MjData, MjModel, MjSpec, MjrContext, MjrRectangle, MjtGeomBase, MjtObj, MjvCamera, MjvOption, MjvPerturb, MjvScene,
};
use nalgebra::{UnitQuaternion, Vector3};
use thiserror::Error;

/// Nearest and farthest depth that is drawn, metres.
const DEPTHS_M: [f64; 2] = [0.05, 60.0];
/// Sides of what is round, so that it is round to less than a millimetre.
const SIDES: i32 = 128;

/// A camera at its place; optical frame: +z forward, x right, y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Square pixels and a centred principal point.
    pub model: CameraModel,
    /// Where it is.
    pub world_from_camera: Pose,
}

/// Depth and labels, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Along the optical axis, metres; 0 where there is nothing.
    pub depth_m: Vec<f32>,
    /// [`label_of_body`] of the scene's bodies; 0 where there is nothing.
    pub labels: Vec<u32>,
}

/// Why MuJoCo draws nothing.
#[derive(Debug, Error, PartialEq)]
pub enum PictureError {
    /// The scene cannot be made a model.
    #[error(transparent)]
    Scene(#[from] PhysicsError),
    /// There is no OpenGL here.
    #[error("no OpenGL without a display: {0}")]
    NoGl(String),
}

/// The scene at rest as a model of what is seen of it, and the label of each of its geoms.
fn seen(scene: &SceneModel, eyes: &[Eye]) -> Result<(Box<MjModel>, Vec<u32>), PhysicsError> {
    route_messages();
    let mut spec = MjSpec::new();
    spec.compiler_mut().set_degree(true);
    add_scene_meshes(&mut spec, scene, |geom| geom.visible)?;
    let mut labels = Vec::new();
    for (index, body) in scene.bodies.iter().enumerate() {
        let is_drawn = |material: usize| scene.materials.get(material).is_none_or(|m| m.rgba[3] >= VISIBLE_ALPHA);
        for geom in body.geoms.iter().filter(|geom| geom.visible && is_drawn(geom.material)) {
            let pose = body.world_from_body * geom.body_from_geom;
            let added = spec.world_body_mut().add_geom();
            match geom.shape {
                SceneShape::Plane { half_m: [x, y] } => {
                    added.set_type(MjtGeomBase::mjGEOM_PLANE);
                    *added.size_mut() = [x, y, 1.0];
                    *added.pos_mut() = pose.translation.vector.into();
                    *added.quat_mut() = wxyz(&pose.rotation);
                }
                ref shape => set_shape(added, &body.name, shape, pose)?,
            }
            labels.push(label_of_body(index));
        }
    }
    // MuJoCo's cameras look along -z with y up.
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    for eye in eyes {
        let added = spec.world_body_mut().add_camera();
        *added.pos_mut() = eye.world_from_camera.translation.vector.into();
        *added.quat_mut() = wxyz(&(eye.world_from_camera.rotation * turn));
        added.set_fovy((0.5 * f64::from(eye.model.height) / eye.model.fy).atan().to_degrees() * 2.0);
    }
    let mut model = Box::new(spec.compile().map_err(refused)?);
    model.stat_mut().extent = 1.0;
    let visual = model.vis_mut();
    [visual.map.znear, visual.map.zfar] = DEPTHS_M.map(|depth| depth as f32);
    visual.global.offwidth = eyes.iter().map(|eye| eye.model.width as i32).max().unwrap_or(1);
    visual.global.offheight = eyes.iter().map(|eye| eye.model.height as i32).max().unwrap_or(1);
    (visual.quality.offsamples, visual.quality.shadowsize) = (0, 0);
    (visual.quality.numslices, visual.quality.numstacks) = (SIDES, SIDES);
    Ok((model, labels))
}

/// What MuJoCo's own renderer draws of the scene, without the robot, in an OpenGL context that needs no display.
///
/// # Errors
/// [`PictureError::NoGl`] on a machine without EGL or OpenGL.
pub fn draw(scene: &SceneModel, eyes: &[Eye]) -> Result<Vec<Picture>, PictureError> {
    let (model, labels) = seen(scene, eyes)?;
    let _gl = GlContext::new().map_err(PictureError::NoGl)?;
    // SAFETY: `_gl` is current in this thread and outlives the context.
    let mut context = unsafe { MjrContext::new(&model) };
    context.offscreen();
    let mut drawn = MjvScene::new(&model, labels.len() + eyes.len());
    drawn.flags_mut().fill(0);
    for flag in [mjtRndFlag::mjRND_SEGMENT, mjtRndFlag::mjRND_IDCOLOR, mjtRndFlag::mjRND_CULL_FACE] {
        drawn.flags_mut()[flag as usize] = 1;
    }
    let mut data = MjData::new(model);
    data.forward();
    let mut pictures = Vec::new();
    for (index, eye) in eyes.iter().enumerate() {
        let mut camera = MjvCamera::new_fixed(index);
        drawn.update(&mut data, &MjvOption::default(), &MjvPerturb::default(), &mut camera);
        let (width, height) = (eye.model.width as usize, eye.model.height as usize);
        let view = MjrRectangle { left: 0, bottom: 0, width: width as i32, height: height as i32 };
        drawn.render(&view, &context);
        let (mut colors, mut depths) = (vec![0; 3 * width * height], vec![0.0; width * height]);
        let read = context.read_pixels(Some(&mut colors), Some(&mut depths), &view);
        read.map_err(|error| PictureError::NoGl(error.to_string()))?;
        let label = |color: &[u8]| {
            let segment = usize::from(color[0]) | usize::from(color[1]) << 8 | usize::from(color[2]) << 16;
            let geom = segment.checked_sub(1).and_then(|segment| drawn.geoms().get(segment))?;
            let is_geom = geom.objtype == MjtObj::mjOBJ_GEOM as i32;
            is_geom.then(|| labels.get(geom.objid as usize).copied()).flatten()
        };
        let [near, far] = DEPTHS_M;
        let mut picture = Picture::default();
        for row in (0..height).rev() {
            for pixel in row * width..(row + 1) * width {
                let label = label(&colors[3 * pixel..3 * pixel + 3]).unwrap_or(0);
                let depth_m = near * far / (far - f64::from(depths[pixel]) * (far - near));
                picture.labels.push(label);
                picture.depth_m.push(if label == 0 { 0.0 } else { depth_m as f32 });
            }
        }
        pictures.push(picture);
    }
    Ok(pictures)
}

/// What MuJoCo's rays through the centres of the pixels meet first: exact solids instead of their triangles, and no
/// OpenGL.
///
/// # Errors
/// [`PhysicsError`] when the scene cannot be made a model.
pub fn cast_rays(scene: &SceneModel, eye: &Eye) -> Result<Picture, PhysicsError> {
    let (model, labels) = seen(scene, &[])?;
    let mut data = MjData::new(model);
    data.forward();
    let pixels = (0..eye.model.height).flat_map(|row| (0..eye.model.width).map(move |column| (column, row)));
    // Rays of depth 1: the distance along them in their own lengths is the depth.
    let rays: Vec<[f64; 3]> = pixels
        .map(|(column, row)| {
            let ray = eye.model.back_project(column, row, 1.0).coords;
            (eye.world_from_camera.rotation * ray).into()
        })
        .collect();
    let from = eye.world_from_camera.translation.vector.into();
    let (geoms, depths) = data.multi_ray(&from, &rays, None, true, None, DEPTHS_M[1], None);
    let labels: Vec<u32> = geoms.iter().map(|geom| geom.and_then(|g| labels.get(g).copied()).unwrap_or(0)).collect();
    let depth = |(depth, label): (&f64, &u32)| if *label == 0 { 0.0 } else { *depth as f32 };
    let depth_m = depths.iter().zip(&labels).map(depth).collect();
    Ok(Picture { depth_m, labels })
}
