use std::fs;

/// Returns the largest resident memory of this process so far, where Linux counts it.
pub(crate) fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = peak.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn peak_memory_grows_with_what_is_written() {
        let before = peak_memory_bytes().unwrap();
        let written = vec![1_u8; 256 << 20];
        let after = peak_memory_bytes().unwrap();
        assert_eq!(written.last(), Some(&1));
        // Other tests of this process may end meanwhile, but a peak never falls.
        assert!(after >= before && after >= 256 << 20, "{before} {after}");
    }
}
