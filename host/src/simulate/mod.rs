//! `hybray simulate`: renders on a virtual machine, and what is written about them.

pub mod csv;
mod figures;
pub mod html;
#[cfg(test)]
mod made_up;
pub mod record;
pub mod runs;
mod svg;
mod text;
