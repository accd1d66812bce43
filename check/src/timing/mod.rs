pub mod bandwidth;
pub mod speed;
