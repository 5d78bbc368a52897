//! Holds in the repository, where this crate lies beside others; not part of its package.

use std::fs;
use std::path::Path;

#[test]
fn the_description_in_the_repository_s_assets_is_the_one_that_the_crate_holds() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &Path| fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let shown = read(&crate_folder.join("../../assets/nao/nao.urdf"));
    assert_eq!(read(&crate_folder.join("assets/nao.urdf")), shown, "copy crates/sim/assets/nao.urdf to assets/nao");
    assert_eq!(scrnn_sim::robot::nao::URDF, shown);
}
