//! Memory of processes, where Linux counts it.

use std::fs;

/// Returns the largest resident memory of this process so far, in bytes.
pub(crate) fn peak_memory_bytes() -> Option<u64> {
    field("self", "VmHWM:")
}

/// Returns the resident memory of a process now, in bytes.
#[must_use]
pub fn resident_memory_bytes(process: u32) -> Option<u64> {
    field(&process.to_string(), "VmRSS:")
}

fn field(process: &str, name: &str) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let value = status.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = value.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn memory_grows_with_what_is_written() {
        let before = peak_memory_bytes().unwrap();
        let written = vec![1_u8; 256 << 20];
        let now = resident_memory_bytes(std::process::id()).unwrap();
        let after = peak_memory_bytes().unwrap();
        assert_eq!(written.last(), Some(&1));
        // Other tests of this process may end meanwhile, but a peak never falls.
        assert!(after >= before && after >= now && now >= 256 << 20, "{before} {now} {after}");
    }
}
