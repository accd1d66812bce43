// Stubs for kernels without membranes, which are faster.

fn held_back(path: Path, kind: SpeciesRow, id: u32) -> Path {
    return path;
}

fn is_separated(kind: SpeciesRow, a: vec3<f32>, b: vec3<f32>) -> bool {
    return false;
}
