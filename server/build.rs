//! Builds the dashboard with npm into the build's own folder, from which it is embedded, when one of its sources
//! has changed; and gives the build a name that another build has only if its code is the same.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// What the dashboard is made of, below `web/`; its client is made from the description of the interface.
const DASHBOARD: [&str; 8] = [
    "src",
    "../docs/openapi.json",
    "index.html",
    "package.json",
    "package-lock.json",
    "svelte.config.js",
    "tsconfig.json",
    "vite.config.ts",
];
/// What numbers and their storage are made of, below the root: everything but the dashboard.
const CODE: [&str; 8] = [
    "Cargo.toml",
    "Cargo.lock",
    "migrations",
    "server/Cargo.toml",
    "server/build.rs",
    "server/src",
    "solver/Cargo.toml",
    "solver/src",
];
/// What the compiler was told, as far as it may change a number.
const SETTINGS: [&str; 4] =
    ["TARGET", "OPT_LEVEL", "CARGO_ENCODED_RUSTFLAGS", "CARGO_CFG_TARGET_FEATURE"];
/// Hex digits of a build's name.
const DIGITS: usize = 12;

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for source in CODE {
        println!("cargo:rerun-if-changed=../{source}");
    }
    for source in DASHBOARD {
        println!("cargo:rerun-if-changed=../web/{source}");
    }
    println!("cargo:rustc-env=MELANGE_BUILD={}", name_of_build(&root));
    dashboard(&root.join("web"));
}

/// A hash of the code, the compiler and its settings. It asks no version control, so that a tarball will do, and
/// so that changes that are not committed count.
fn name_of_build(root: &Path) -> String {
    let mut hasher = hash_of(root, &CODE);
    for setting in SETTINGS {
        let value = env::var(setting).unwrap_or_default();
        hasher.update(format!("{setting}={value}\n").as_bytes());
    }
    let rustc = env::var_os("RUSTC").expect("cargo sets RUSTC");
    let version = Command::new(rustc).arg("-vV").output().expect("the compiler tells its version");
    hasher.update(&version.stdout);
    hasher.finalize().to_hex()[..DIGITS].to_owned()
}

/// Hash of files and folders, with their names. What is not there, such as a lock file, counts as nothing.
fn hash_of(folder: &Path, names: &[&str]) -> blake3::Hasher {
    let mut hasher = blake3::Hasher::new();
    for name in names {
        add(&mut hasher, &folder.join(name), name);
    }
    hasher
}

fn add(hasher: &mut blake3::Hasher, path: &Path, name: &str) {
    if path.is_dir() {
        let entries = fs::read_dir(path).expect("the folder can be read");
        let names = entries.map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<String> = names.map(|n| n.to_string_lossy().into_owned()).collect();
        names.sort();
        for inner in names {
            add(hasher, &path.join(&inner), &format!("{name}/{inner}"));
        }
    } else if let Ok(bytes) = fs::read(path) {
        hasher.update(format!("{name} {}\n", bytes.len()).as_bytes());
        hasher.update(&bytes);
    }
}

/// Builds the dashboard, unless the one that is there is made of the same files.
fn dashboard(web: &Path) {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let target = out.join("web");
    let built = out.join("web.blake3");
    let sources = hash_of(web, &DASHBOARD).finalize().to_hex().to_string();
    let is_built = fs::read_to_string(&built).is_ok_and(|hash| hash == sources);
    if is_built && target.join("index.html").is_file() {
        return;
    }
    if !is_installed(web) {
        npm(web, &["ci", "--no-audit", "--no-fund"]);
    }
    let target = target.to_str().expect("the target folder's path is UTF-8");
    npm(web, &["run", "build", "--", "--outDir", target, "--emptyOutDir", "--logLevel", "warn"]);
    fs::write(&built, sources).expect("the build's folder can be written");
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
