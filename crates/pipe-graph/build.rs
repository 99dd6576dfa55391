//! Lists `shaders/lib`, so that a new file there is a new module without being named anywhere.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::{env, fs};

#[allow(clippy::unnecessary_debug_formatting)] // A quoted path is what the generated source needs.
fn main() {
    let folder = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("../../shaders/lib");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut files: Vec<PathBuf> = fs::read_dir(&folder)
        .expect("the repository has shaders/lib")
        .map(|entry| entry.expect("the folder can be listed").path())
        .filter(|path| path.extension().is_some_and(|e| e == "wgsl"))
        .collect();
    files.sort();
    let mut table = String::from("[\n");
    for file in files {
        let path = file.canonicalize().expect("the file was just listed");
        let name = path.file_stem().expect("it has an ending").to_string_lossy().into_owned();
        writeln!(table, "    ({name:?}, include_str!({path:?})),").expect("a string takes everything");
    }
    table.push(']');
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it")).join("library.rs");
    fs::write(out, table).expect("cargo's folder can be written");
}
