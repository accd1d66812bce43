struct Born {
    sphere: vec4<f32>,
    velocity: vec3<f32>,
    species: u32,
}
