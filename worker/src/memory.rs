//! Memory of the machine.

use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Returns the memory that this process may use, in bytes: the machine's, or less where a container has less.
#[must_use]
pub fn memory_bytes() -> u64 {
    let memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(memory);
    match system.cgroup_limits() {
        Some(limits) => system.total_memory().min(limits.total_memory),
        None => system.total_memory(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_memory() {
        assert!(memory_bytes() > 64 << 20);
    }
}
