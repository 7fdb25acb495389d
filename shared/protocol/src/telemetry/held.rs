use prometheus_client::metrics::gauge::Gauge;

/// Raises a gauge by one until it is dropped.
#[derive(Debug)]
pub struct Held(Gauge);

impl Held {
    /// Raises this gauge.
    #[must_use]
    pub fn new(gauge: &Gauge) -> Self {
        gauge.inc();
        Self(gauge.clone())
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.0.dec();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_counted() {
        let gauge = Gauge::default();
        let held = [Held::new(&gauge), Held::new(&gauge)];
        assert_eq!(gauge.get(), 2);
        drop(held);
        assert_eq!(gauge.get(), 0);
    }
}
