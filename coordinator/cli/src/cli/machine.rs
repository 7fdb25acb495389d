use std::fs;

use sysinfo::{CpuRefreshKind, RefreshKind, System};

/// The processor, how many of its cores this process may use, and the operating system, for people.
pub fn describe() -> String {
    let system = System::new_with_specifics(RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing()));
    let processor = system.cpus().first().map(|cpu| cpu.brand().trim()).filter(|brand| !brand.is_empty());
    let cores = std::thread::available_parallelism().map(|cores| match cores.get() {
        1 => "1 core".to_owned(),
        cores => format!("{cores} cores"),
    });
    [
        Some(processor.unwrap_or(std::env::consts::ARCH).to_owned()),
        cores.ok(),
        Some(System::long_os_version().unwrap_or_else(|| std::env::consts::OS.to_owned())),
    ]
    .into_iter()
    .flatten()
    .collect::<Vec<_>>()
    .join(", ")
}

/// Largest memory of this process so far, resident, as Linux counts it; none on other systems.
pub fn peak_memory_bytes() -> Option<u64> {
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

    #[test]
    fn a_machine_has_a_name_and_cores() {
        let text = describe();
        assert!(text.contains(" core"), "{text}");
        assert!(text.split(", ").all(|part| !part.is_empty()), "{text}");
    }
}
