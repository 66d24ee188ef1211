//! A furnished room with 60 bodies, for tests, benchmarks and pictures of the rasteriser.

use dsm::Pose;
use dsm::raster::{Instance, Light, Material, Mesh, MeshIndex, Scene, Texture, look_at};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};

/// The view of the room used for pictures and times.
pub(crate) fn view() -> Pose {
    look_at(&Point3::new(-2.6, -1.9, 1.5), &Point3::new(0.6, 0.4, 0.5))
}

/// A room of 6 x 5 m with 60 bodies; `detail` is the number of segments around the round ones (72: 50 000 triangles).
pub(crate) fn room(detail: u32) -> Scene {
    let mut scene = Scene::default();
    scene.ambient = [0.32, 0.33, 0.36];
    scene.lights = vec![
        Light::Directional { direction_in_world: Vector3::new(0.5, 0.35, -0.9), color: [0.45, 0.43, 0.40] },
        Light::Point { position_in_world: Point3::new(0.0, 0.0, 2.3), color: [0.55, 0.52, 0.46], range_m: 2.5 },
    ];
    let textures = [
        Texture::wood(6, [196, 150, 100], [120, 78, 46], 3),
        Texture::checker(4, [230, 228, 220], [90, 110, 130]),
        Texture::bricks(4, 8, [172, 92, 70], [205, 200, 190]),
        Texture::speckle([160, 60, 50], [200, 120, 90], 5),
        Texture::gradient([60, 90, 170], [210, 220, 240]),
    ]
    .map(|texture| scene.add_texture(texture));
    let mut label = 0;
    let mut add = |scene: &mut Scene, mesh: MeshIndex, material: Material, place: [f64; 3], yaw_rad: f64| {
        label += 1;
        let material = scene.add_material(material);
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
        let world_from_mesh = Pose::from_parts(Translation3::new(place[0], place[1], place[2]), rotation);
        scene.instances.push(Instance { mesh, material, world_from_mesh, label, casts_shadow: true });
    };
    let white = Material { color: [1.0; 3], ..Material::default() };
    let floor = scene.add_mesh(Mesh::plane(3.0, 2.5, 8));
    add(&mut scene, floor, Material { texture: Some(textures[0]), texture_repeat: [2.0, 2.5], ..white }, [0.0; 3], 0.0);
    let long = scene.add_mesh(Mesh::cuboid(Vector3::new(3.0, 0.05, 1.25)));
    let short = scene.add_mesh(Mesh::cuboid(Vector3::new(0.05, 2.5, 1.25)));
    let wall = Material { color: [0.86, 0.84, 0.78], specular: 0.0, ..Material::default() };
    add(
        &mut scene,
        long,
        Material { texture: Some(textures[2]), texture_repeat: [4.0, 1.6], ..white },
        [0.0, 2.5, 1.25],
        0.0,
    );
    add(&mut scene, short, wall, [3.0, 0.0, 1.25], 0.0);
    let table = scene.add_mesh(Mesh::cuboid(Vector3::new(0.7, 0.4, 0.02)));
    add(&mut scene, table, Material { texture: Some(textures[0]), specular: 0.3, ..white }, [0.6, 0.4, 0.72], 0.3);
    let leg = scene.add_mesh(Mesh::cylinder(0.03, 0.35, detail));
    for (x, y) in [(0.05, 0.1), (0.05, 0.75), (1.2, 0.1), (1.2, 0.75)] {
        add(&mut scene, leg, Material { color: [0.25; 3], specular: 0.6, ..Material::default() }, [x, y, 0.35], 0.0);
    }
    let solids = [
        scene.add_mesh(Mesh::sphere(0.05, detail / 2)),
        scene.add_mesh(Mesh::cylinder(0.045, 0.08, detail)),
        scene.add_mesh(Mesh::capsule(0.04, 0.07, detail / 2)),
        scene.add_mesh(Mesh::ellipsoid(Vector3::new(0.08, 0.05, 0.04), detail / 2)),
        scene.add_mesh(Mesh::cuboid(Vector3::new(0.07, 0.05, 0.1))),
    ];
    let heights = [0.05, 0.08, 0.11, 0.04, 0.1];
    for number in 0..52_usize {
        let (kind, on_table) = (number % 5, number < 12);
        let (column, row) = ((number % 4) as f64, (number / 4) as f64);
        let place = if on_table {
            [0.2 + 0.28 * column, 0.2 + 0.2 * row, 0.74 + heights[kind]]
        } else {
            [-1.8 + 1.1 * column + 0.13 * row, -2.0 + 0.33 * row, heights[kind]]
        };
        let hue = number as f32 * 0.618;
        let color = [0.0, 0.33, 0.67].map(|shift| 0.5 + 0.4 * ((hue + shift) * std::f32::consts::TAU).sin());
        let texture = (number % 3 == 0).then(|| textures[1 + number % 4]);
        let color = if texture.is_some() { [1.0; 3] } else { color };
        add(
            &mut scene,
            solids[kind],
            Material { color, texture, specular: 0.4, ..Material::default() },
            place,
            hue.into(),
        );
    }
    scene
}
