//! Vectors, rays, boxes, primitives, pyramids and bundles: every floating-point decision of Hybray.
#![no_std]
#![forbid(unsafe_code)]
