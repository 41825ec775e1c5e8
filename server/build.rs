//! Builds the dashboard with npm into the build's own folder, from which it is embedded. Cargo runs
//! this when a source of the dashboard is newer than the last build.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// What the dashboard is made of, below `web/`.
const SOURCES: [&str; 7] = [
    "src",
    "index.html",
    "package.json",
    "package-lock.json",
    "svelte.config.js",
    "tsconfig.json",
    "vite.config.ts",
];

fn main() {
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("../web");
    for source in SOURCES {
        println!("cargo:rerun-if-changed=../web/{source}");
    }
    println!("cargo:rerun-if-changed=../migrations");
    println!("cargo:rerun-if-changed=build.rs");
    let target = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR")).join("web");
    if !is_installed(&web) {
        npm(&web, &["ci", "--no-audit", "--no-fund"]);
    }
    let target = target.to_str().expect("the target folder's path is UTF-8");
    npm(&web, &["run", "build", "--", "--outDir", target, "--emptyOutDir", "--logLevel", "warn"]);
}

/// Whether `node_modules` is at least as new as the lock file.
fn is_installed(web: &Path) -> bool {
    let modified = |path: &str| fs::metadata(web.join(path)).and_then(|m| m.modified()).ok();
    match (modified("node_modules/.package-lock.json"), modified("package-lock.json")) {
        (Some(installed), Some(locked)) => installed >= locked,
        _ => false,
    }
}

fn npm(web: &Path, arguments: &[&str]) {
    let output = Command::new("npm").args(arguments).current_dir(web).output().unwrap_or_else(|e| {
        panic!("the dashboard is built with npm, which cannot be run ({e}): install Node.js 20 or newer")
    });
    assert!(
        output.status.success(),
        "npm {} failed:\n{}{}",
        arguments.join(" "),
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}
