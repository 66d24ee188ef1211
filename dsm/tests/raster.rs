//! Contract: the rasteriser sees what a ray through each pixel's centre meets first, and says so alike for any number
//! of threads.

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::raster::{Image, Instance, Light, Material, Mesh, RenderOptions, Renderer, Scene, Splats, look_at, render};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

mod raster_room;

fn camera() -> CameraModel {
    CameraModel::from_vertical_fov(320, 240, 1.0)
}

fn one(mesh: Mesh, world_from_mesh: Pose, label: u32) -> Scene {
    let mut scene = Scene::default();
    scene.ambient = [0.5; 3];
    let mesh = scene.add_mesh(mesh);
    let material = scene.add_material(Material::default());
    scene.instances.push(Instance { mesh, material, world_from_mesh, label, casts_shadow: true });
    scene
}

/// Depth along z at which the ray through a pixel's centre enters the box; `None` when it misses.
fn cast_at_box(
    camera: &CameraModel,
    column: u32,
    row: u32,
    camera_from_box: &Pose,
    half: &Vector3<f64>,
) -> Option<f64> {
    let eye = camera_from_box.inverse_transform_point(&Point3::origin());
    let ray = camera_from_box.inverse_transform_vector(&camera.back_project(column, row, 1.0).coords);
    let (mut near, mut far) = (f64::MIN, f64::MAX);
    for axis in 0..3 {
        let (a, b) = ((-half[axis] - eye[axis]) / ray[axis], (half[axis] - eye[axis]) / ray[axis]);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    (near <= far && near > 0.0).then_some(near)
}

/// Compares an image of a single box with rays; only pixels within `slack` of a silhouette may differ.
fn compare_with_rays(image: &Image, camera_from_box: &Pose, half: &Vector3<f64>) {
    let camera = camera();
    let (mut seen, mut differing) = (0, 0);
    for row in 0..camera.height {
        for column in 0..camera.width {
            let pixel = (row * camera.width + column) as usize;
            match (cast_at_box(&camera, column, row, camera_from_box, half), image.depth_m[pixel]) {
                (Some(expected), depth) if depth > 0.0 => {
                    seen += 1;
                    assert_eq!(image.labels[pixel], 5);
                    let error = (f64::from(depth) - expected).abs();
                    assert!(error < 2e-5 * expected, "depth {depth} for {expected} at {column}, {row}");
                }
                (None, 0.0) => assert_eq!(image.labels[pixel], 0),
                _ => differing += 1,
            }
        }
    }
    assert!(seen > 1000, "only {seen} pixels");
    assert!(differing <= 3, "{differing} pixels differ at the silhouette");
}

#[test]
fn a_turned_box_has_the_depth_that_rays_find() {
    let half = Vector3::new(0.4, 0.3, 0.2);
    let world_from_camera = look_at(&Point3::new(-1.5, 0.2, 1.0), &Point3::new(0.1, 0.0, 0.2));
    for step in 0..6 {
        let rotation = UnitQuaternion::from_euler_angles(0.3 * f64::from(step), 0.5, 1.1 * f64::from(step));
        let world_from_box = Isometry3::from_parts(Translation3::new(0.2, 0.05 * f64::from(step), 0.1), rotation);
        let scene = one(Mesh::cuboid(half.cast()), world_from_box, 5);
        let image = render(&scene, &camera(), &world_from_camera, &RenderOptions::default());
        compare_with_rays(&image, &(world_from_camera.inverse() * world_from_box), &half);
    }
}

#[test]
fn a_box_larger_than_the_view_is_cut_at_the_near_plane() {
    // The floor reaches from behind the camera to far ahead.
    let half = Vector3::new(20.0, 0.5, 20.0);
    let world_from_box = Pose::translation(0.0, 1.7, 0.0);
    let scene = one(Mesh::cuboid(half.cast()), world_from_box, 5);
    let image = render(&scene, &camera(), &Pose::identity(), &RenderOptions::default());
    compare_with_rays(&image, &world_from_box, &half);
    // With the near plane beyond where the floor enters the view, only the farther part remains.
    let options = RenderOptions { near_m: 4.0, ..RenderOptions::default() };
    let image = render(&scene, &camera(), &Pose::identity(), &options);
    let depths: Vec<f32> = image.depth_m.iter().copied().filter(|&depth| depth > 0.0).collect();
    let nearest = depths.iter().copied().fold(f32::MAX, f32::min);
    assert!((4.0..4.1).contains(&nearest), "{nearest}");
}

#[test]
fn nothing_outside_the_view_or_beyond_its_ends_is_drawn() {
    let cube = || Mesh::cuboid(Vector3::repeat(0.1));
    // At 2 m the half width of the view is tan(0.5) * 4/3 * 2.
    let edge = 0.5_f64.tan() * 4.0 / 3.0 * 2.0;
    let seen = |x: f64, z: f64, options: &RenderOptions| {
        let scene = one(cube(), Pose::translation(x, 0.0, z), 1);
        render(&scene, &camera(), &Pose::identity(), options).labels.iter().filter(|&&label| label == 1).count()
    };
    let options = RenderOptions::default();
    for sign in [-1.0, 1.0] {
        assert!(seen(sign * (edge - 0.02), 2.0, &options) > 0);
        assert_eq!(seen(sign * (edge + 0.2), 2.0, &options), 0);
    }
    assert_eq!(seen(0.0, -2.0, &options), 0);
    assert_eq!(seen(0.0, 2.0, &RenderOptions { far_m: 1.8, ..options }), 0);
    assert_eq!(seen(0.0, 2.0, &RenderOptions { near_m: 2.2, ..options }), 0);
    // Inside a closed solid only faces that look away are near: they are culled.
    assert_eq!(seen(0.0, 0.0, &options), 0);
}

#[test]
fn neighbouring_triangles_leave_no_hole_and_no_pixel_twice() {
    // A fan of slivers that covers the whole view, in front of a wall.
    let camera = camera();
    let mut positions = vec![Point3::new(0.013, -0.007, 1.0_f32)];
    let count = 701_u32;
    for i in 0..count {
        let angle = i as f32 / count as f32 * std::f32::consts::TAU;
        positions.push(Point3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0));
    }
    // Seen from the camera (y down) the fan must run clockwise in x and y.
    let triangles: Vec<[u32; 3]> = (0..count).map(|i| [0, (i + 1) % count + 1, i + 1]).collect();
    let mut scene = one(Mesh::from_triangles(&positions, &triangles, 0.5).expect("sound"), Pose::identity(), 1);
    let wall = scene.add_mesh(Mesh::cuboid(Vector3::new(9.0, 9.0, 0.1)));
    let material = scene.add_material(Material::default());
    let behind = Pose::translation(0.0, 0.0, 1.2);
    scene.instances.push(Instance { mesh: wall, material, world_from_mesh: behind, label: 2, casts_shadow: true });
    let image = render(&scene, &camera, &Pose::identity(), &RenderOptions::default());
    assert!(image.labels.iter().all(|&label| label == 1));
    assert!(image.depth_m.iter().all(|depth| (depth - 1.0).abs() < 1e-5));
}

#[test]
fn of_two_surfaces_at_one_place_the_first_wins() {
    let mut scene = one(Mesh::cuboid(Vector3::repeat(0.3)), Pose::translation(0.0, 0.0, 2.0), 1);
    let twin = Instance { label: 2, ..scene.instances[0] };
    scene.instances.push(twin);
    let image = render(&scene, &camera(), &Pose::identity(), &RenderOptions::default());
    assert!(image.labels.contains(&1));
    assert!(!image.labels.contains(&2));
}

#[test]
fn the_image_does_not_depend_on_threads_or_on_what_was_drawn_before() {
    let mut scene = raster_room::room(16);
    scene.cast_shadows(0);
    let options = RenderOptions::default();
    let images: Vec<Image> = [1, 4]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can start");
            pool.install(|| {
                let mut renderer = Renderer::default();
                let mut image =
                    renderer.render(&scene, &CameraModel::from_vertical_fov(99, 61, 1.4), &Pose::identity(), &options);
                renderer.render_into(&scene, &camera(), &raster_room::view(), &options, &mut image);
                image
            })
        })
        .collect();
    assert_eq!(images[0], images[1]);
    assert!(images[0] == render(&scene, &camera(), &raster_room::view(), &options));
    let labels: std::collections::BTreeSet<u32> = images[0].labels.iter().copied().collect();
    assert!(labels.len() > 40, "only {} bodies seen", labels.len());
}

#[test]
fn light_falls_on_the_side_that_faces_it() {
    let mut scene = one(Mesh::sphere(0.5, 32), Pose::translation(0.0, 0.0, 2.0), 1);
    scene.ambient = [0.05; 3];
    scene.lights.push(Light::Directional { direction_in_world: Vector3::x(), color: [1.0; 3] });
    let image = render(&scene, &camera(), &Pose::identity(), &RenderOptions::default());
    let middle = 120 * 320;
    let (left, right) = (image.color[middle + 160 - 40], image.color[middle + 160 + 40]);
    assert!(u32::from(left[0]) > 2 * u32::from(right[0]), "{left:?} and {right:?}");
    // The light from the left must not reach the right half: there is only the ambient light.
    assert!(right[0] < 60, "{right:?}");
}

#[test]
fn points_show_their_own_colour_depth_and_label_behind_nearer_things() {
    let mut scene = one(Mesh::cuboid(Vector3::repeat(0.1)), Pose::translation(-0.3, 0.0, 1.5), 1);
    let points = vec![Point3::new(0.3, 0.0, 2.0), Point3::new(-0.5, 0.0, 3.0), Point3::new(0.0, 0.0, -1.0)];
    let colors = vec![[10, 200, 30], [1, 2, 3], [9, 9, 9]];
    scene.splats.push(Splats { points_in_world: points, colors, radius_m: 0.02, label: 4 });
    let camera = camera();
    let image = render(&scene, &camera, &Pose::identity(), &RenderOptions::default());
    let (column, row) = camera.find_pixel(&Point3::new(0.3, 0.0, 2.0)).expect("in view");
    let pixel = (row * camera.width + column) as usize;
    assert_eq!((image.color[pixel], image.labels[pixel]), ([10, 200, 30], 4));
    assert!((image.depth_m[pixel] - 2.0).abs() < 1e-6);
    let (column, row) = camera.find_pixel(&Point3::new(-0.5, 0.0, 3.0)).expect("in view");
    assert_eq!(image.labels[(row * camera.width + column) as usize], 1);
    let area = image.labels.iter().filter(|&&label| label == 4).count() as f64;
    let expected = std::f64::consts::PI * (0.02 * camera.fx / 2.0).powi(2);
    assert!((area / expected - 1.0).abs() < 0.35, "{area} pixels for {expected}");
}

#[test]
fn a_texture_stays_where_it_is_in_perspective() {
    // A long floor with 20 x 20 squares of 1 m, seen at a low angle: the colour at a ray's foot follows from its place.
    let mut scene = Scene::default();
    scene.ambient = [1.0; 3];
    let texture = scene.add_texture(dsm::raster::Texture::checker(2, [255; 3], [0; 3]));
    let mesh = scene.add_mesh(Mesh::plane(10.0, 10.0, 1));
    let look = Material {
        color: [1.0; 3],
        texture: Some(texture),
        texture_repeat: [10.0; 2],
        specular: 0.0,
        ..Material::default()
    };
    let material = scene.add_material(look);
    scene.instances.push(Instance { mesh, material, world_from_mesh: Pose::identity(), label: 1, casts_shadow: true });
    let pose = look_at(&Point3::new(-4.0, 0.3, 1.2), &Point3::new(0.0, 0.5, 0.0));
    let camera = camera();
    let image = render(&scene, &camera, &pose, &RenderOptions::default());
    let (mut right, mut total) = (0, 0);
    for (pixel, &depth) in image.depth_m.iter().enumerate().filter(|(_, depth)| **depth > 0.0 && **depth < 4.0) {
        let foot = pose * camera.back_project(pixel as u32 % 320, pixel as u32 / 320, f64::from(depth));
        assert!(foot.z.abs() < 1e-4);
        let from_line = |c: f64| (c - c.round()).abs();
        if from_line(foot.x) > 0.1 && from_line(foot.y) > 0.1 {
            let white = (foot.x.floor() as i64 + foot.y.floor() as i64) % 2 != 0;
            total += 1;
            right += usize::from((image.color[pixel][0] > 128) == white);
        }
    }
    assert!(total > 10_000, "{total}");
    assert_eq!(right, total);
}

/// A box of 0.4 m floats 1 m above a floor of 6 x 6 m; light falls at a slant. Seen from above.
fn floating_box(place: Point3<f64>) -> (Scene, Pose) {
    let mut scene = Scene::default();
    scene.ambient = [0.3; 3];
    scene.lights.push(Light::Directional { direction_in_world: Vector3::new(0.5, 0.2, -1.0), color: [0.5; 3] });
    let material = scene.add_material(Material { specular: 0.0, ..Material::default() });
    let floor = scene.add_mesh(Mesh::cuboid(Vector3::new(3.0, 3.0, 0.05)));
    let cube = scene.add_mesh(Mesh::cuboid(Vector3::repeat(0.2)));
    let floor_pose = Pose::translation(0.0, 0.0, -0.05);
    let pose = Pose::translation(place.x, place.y, place.z);
    scene.instances = vec![
        Instance { mesh: floor, material, world_from_mesh: floor_pose, label: 1, casts_shadow: true },
        Instance { mesh: cube, material, world_from_mesh: pose, label: 2, casts_shadow: true },
    ];
    (scene, look_at(&Point3::new(0.0, 0.0, 4.0), &Point3::new(0.1, 0.0, 0.0)))
}

#[test]
fn a_shadow_lies_where_something_stands_between_floor_and_light() {
    let (mut scene, pose) = floating_box(Point3::new(-0.4, 0.1, 1.0));
    scene.cast_shadows(0);
    let camera = camera();
    let image = render(&scene, &camera, &pose, &RenderOptions::default());
    let bright = image.color[2 * 320 + 160][0];
    let (mut shaded, mut lit) = (0, 0);
    for (pixel, &depth) in image.depth_m.iter().enumerate() {
        let place = pose * camera.back_project(pixel as u32 % 320, pixel as u32 / 320, f64::from(depth));
        let color = image.color[pixel][0];
        if image.labels[pixel] == 2 {
            if place.z > 1.19 {
                // The top is lit evenly: nothing lies in its own shadow.
                assert_eq!(color, bright, "at {place}");
            }
            continue;
        }
        // Back along the light to the slab between the faces of the box.
        let meets = |slack: f64| {
            (0..=40).any(|step| {
                let height = 0.8 + 0.01 * f64::from(step);
                let (x, y) = (place.x - 0.5 * height + 0.4, place.y - 0.2 * height - 0.1);
                x.abs() < 0.2 + slack && y.abs() < 0.2 + slack
            })
        };
        if meets(-0.03) {
            shaded += 1;
            assert!(color < bright - 20, "{color} at {place} is not in shadow");
        } else if !meets(0.03) {
            lit += 1;
            assert_eq!(color, bright, "at {place}");
        }
    }
    assert!(shaded > 500 && lit > 20_000, "{shaded} shaded, {lit} lit");
}

#[test]
fn shadows_follow_from_where_things_stand_and_not_from_how_they_got_there() {
    let end = Point3::new(0.3, -0.2, 0.7);
    let (mut moved, pose) = floating_box(Point3::new(-0.4, 0.1, 1.0));
    moved.cast_shadows(0);
    let mut images = Vec::new();
    for step in 0..=60 {
        // Moves for a while, and then rests long enough to be counted among the things that stand still.
        let share = f64::from(step.min(30)) / 30.0;
        let place = Point3::new(-0.4, 0.1, 1.0).coords.lerp(&end.coords, share);
        moved.instances[1].world_from_mesh = Pose::translation(place.x, place.y, place.z);
        moved.cast_shadows(0);
        images.push(render(&moved, &camera(), &pose, &RenderOptions::default()));
    }
    assert!(images[0] != images[10]);
    assert!(images[30] == images[60]);
    // Away and back again.
    moved.instances[1].world_from_mesh = Pose::translation(0.0, 0.5, 0.5);
    moved.cast_shadows(0);
    moved.instances[1].world_from_mesh = Pose::translation(end.x, end.y, end.z);
    moved.cast_shadows(0);
    assert!(images[60] == render(&moved, &camera(), &pose, &RenderOptions::default()));
    // A scene that knew nothing of the way: only the map's own window may differ, so the first place is the same.
    let (mut fresh, _) = floating_box(Point3::new(-0.4, 0.1, 1.0));
    fresh.cast_shadows(0);
    fresh.instances[1].world_from_mesh = Pose::translation(end.x, end.y, end.z);
    fresh.cast_shadows(0);
    assert!(images[60] == render(&fresh, &camera(), &pose, &RenderOptions::default()));
}

#[test]
fn what_throws_no_shadow_and_light_without_direction_change_nothing() {
    let (mut scene, pose) = floating_box(Point3::new(-0.4, 0.1, 1.0));
    let plain = render(&scene, &camera(), &pose, &RenderOptions::default());
    scene.instances.iter_mut().for_each(|instance| instance.casts_shadow = false);
    scene.cast_shadows(0);
    assert!(plain == render(&scene, &camera(), &pose, &RenderOptions::default()));
    // There is no second light.
    scene.instances.iter_mut().for_each(|instance| instance.casts_shadow = true);
    scene.cast_shadows(1);
    assert!(plain == render(&scene, &camera(), &pose, &RenderOptions::default()));
    scene.cast_shadows(0);
    assert!(plain != render(&scene, &camera(), &pose, &RenderOptions::default()));
}
