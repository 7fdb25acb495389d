use std::collections::BTreeSet;
use std::fs;
use std::net::TcpListener;

use super::{QUICK, Room, cornell};
use crate::telemetry::figures;

/// Names that begin so are figures.
const PREFIX: &str = "halflight_";

/// What a text says of figures: their names.
fn named(text: &str) -> BTreeSet<&str> {
    let is_of_name = |character: char| character.is_ascii_alphanumeric() || character == '_';
    text.split(|character| !is_of_name(character)).filter(|word| word.starts_with(PREFIX)).collect()
}

/// A dashboard, an alert or an autoscaler on a figure that does not exist shows nothing, never rings, and never scales.
#[test]
fn dashboard_and_alerts_ask_for_figures_that_exist() {
    let room = Room::new();
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let service = room.start(&["--metrics", &address]);
    // One that ends: how jobs ended is shown once some have.
    assert!(!service.result(&service.submit(&cornell(), &QUICK)).is_empty());
    let shown = figures(&address).unwrap();
    let shown: BTreeSet<&str> = shown.keys().filter_map(|figure| figure.split('{').next()).collect();
    let dashboard = fs::read_to_string(tests::data("../deploy/grafana.json")).unwrap();
    let dashboard: serde_json::Value = serde_json::from_str(&dashboard).unwrap();
    let panels = dashboard["panels"].as_array().unwrap();
    assert!(!panels.is_empty());
    for panel in panels {
        let targets = panel["targets"].as_array().unwrap();
        assert!(!targets.is_empty(), "{}", panel["title"]);
        for target in targets {
            let names = named(target["expr"].as_str().unwrap());
            assert!(!names.is_empty() && names.is_subset(&shown), "{}: {names:?}", panel["title"]);
        }
    }
    for file in ["alerts.yml", "kubernetes/components/keda/scaledobject.yaml"] {
        let text = fs::read_to_string(tests::data("../deploy").join(file)).unwrap();
        let names = named(&text);
        assert!(!names.is_empty() && names.is_subset(&shown), "{file}: {names:?}");
    }
}
