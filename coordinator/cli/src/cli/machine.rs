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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_a_name_and_cores() {
        let text = describe();
        assert!(text.contains(" core"), "{text}");
        assert!(text.split(", ").all(|part| !part.is_empty()), "{text}");
    }
}
