//! What of this machine may change the last digits of a result, or its time. Knows no run.

use melange_solver::linalg::vector_instructions;
use std::env::consts::{ARCH, OS};
use std::fs;
use std::sync::LazyLock;

/// The class of this host, such as `x86_64 linux-gnu debian 12, V3, AMD EPYC 7763`: architecture; system, whose
/// mathematical library rounds; vector instructions; processor, by whose features that library chooses too.
pub fn class() -> &'static str {
    static CLASS: LazyLock<String> = LazyLock::new(|| {
        let environment = if cfg!(target_env = "musl") {
            "-musl"
        } else if cfg!(target_env = "gnu") {
            "-gnu"
        } else {
            ""
        };
        let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
        let release = system(&read("/etc/os-release"));
        let mut class = format!("{ARCH} {OS}{environment}{release}, {}", vector_instructions());
        if let Some(processor) = processor(&read("/proc/cpuinfo")) {
            class += &format!(", {processor}");
        }
        class
    });
    &CLASS
}

/// The system's name and version after a space; empty where they are not told.
fn system(os_release: &str) -> String {
    let value = |key: &str| {
        let line = os_release.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        line.map(|value| format!(" {}", value.trim_matches('"'))).unwrap_or_default()
    };
    value("ID") + &value("VERSION_ID")
}

/// The first processor's name.
fn processor(cpuinfo: &str) -> Option<String> {
    let line = cpuinfo.lines().find(|line| line.starts_with("model name"))?;
    let words: Vec<&str> = line.split_once(':')?.1.split_whitespace().collect();
    Some(words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_is_told_by_what_it_says_of_itself() {
        assert_eq!(system("NAME=\"Debian\"\nVERSION_ID=\"12\"\nID=debian\n"), " debian 12");
        assert_eq!(system(""), "");
        let cpuinfo = "processor\t: 0\nmodel name\t: Some  Processor @ 2 GHz\n";
        assert_eq!(processor(cpuinfo).as_deref(), Some("Some Processor @ 2 GHz"));
        assert_eq!(processor("CPU part : 0xd0c"), None);
        assert!(class().starts_with(ARCH), "{}", class());
    }
}
