//! `hybray convert`.

use super::args::ConvertArgs;
use super::{End, camera, load};
use crate::export::export;
use anyhow::Result;

pub(super) fn run(args: &ConvertArgs) -> Result<End> {
    let (model, _) = load(&args.scene, args.size)?;
    let mut camera = camera(&model.cameras, &args.camera)?;
    camera.size = args.size.or(model.settings.size).or(camera.size);
    for warning in model.warnings.iter().chain(&export(&model, &camera, &args.output)?) {
        eprintln!("warning: {warning}");
    }
    eprintln!("{}", args.output.display());
    Ok(End::Done)
}
