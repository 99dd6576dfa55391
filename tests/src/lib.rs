//! What the tests share: a device, small inputs, and a graph run both on the GPU and in double precision.

pub mod bench;
pub mod scattered;
pub mod source;
