#ifdef PERIODIC
fn periods() -> vec3<f32> {
    return vec3(params.period_x, params.period_y, params.period_z);
}
#else
fn periods() -> vec3<f32> {
    return vec3(0.0);
}
#endif
