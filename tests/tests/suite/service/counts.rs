use std::fs;
use std::net::TcpListener;

use tests::programs::{Signal, WorkerProcess};

use super::{ENDLESS, QUICK, Room, cornell, text, wait_for};
use crate::telemetry::figures;

/// All series of a metric together.
fn sum(address: &str, name: &str) -> f64 {
    let figures = figures(address).unwrap_or_default();
    let of_name = |key: &String| key.split('{').next() == Some(name);
    figures.iter().filter(|(key, _)| of_name(key)).map(|(_, value)| value).sum()
}

/// Machines that are taken away in good order ring no alarm.
#[test]
fn a_worker_that_leaves_in_order_is_not_lost() {
    let room = Room::new();
    let metrics = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let mut worker = WorkerProcess::start(3);
    let _service = room.start(&["--workers", &worker.address, "--metrics", &metrics]);
    let shown = |name: &str| sum(&metrics, &format!("halflight_coordinator_{name}"));
    wait_for("the worker is shown", || shown("worker_threads") == 3.0);
    wait_for("its round trip is shown", || shown("worker_round_trip_seconds") > 0.0);
    worker.signal(Signal::TERM);
    assert!(worker.wait().success());
    wait_for("it has left", || shown("left_workers_total") == 1.0);
    assert_eq!(shown("lost_workers_total"), 0.0);
    wait_for("it is shown no more", || shown("worker_threads") == 0.0 && shown("threads") == 0.0);
    assert_eq!(shown("worker_round_trip_seconds"), 0.0);
}

#[test]
fn the_metrics_page_shows_what_was_done() {
    let room = Room::new();
    let metrics = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let service = room.start(&["--jobs", "1", "--metrics", &metrics]);
    let shown = |name: &str| {
        let figures = figures(&metrics).unwrap();
        figures.get(&format!("halflight_service_{name}")).copied().unwrap_or_default()
    };
    for name in ["jobs_submitted_total", "uploads_received_bytes_total", "results_sent_bytes_total"] {
        assert_eq!(shown(name), 0.0, "{name}");
    }
    let scene = fs::metadata(cornell()).unwrap().len() as f64;
    let done = service.submit(&cornell(), &QUICK);
    let lit = service.result(&done).len() as f64;
    assert_eq!(shown("results_sent_bytes_total"), lit);
    assert_eq!(shown("uploads_received_bytes_total"), scene);
    // The same scene is not sent again, and the same file is.
    let again = service.submit(&cornell(), &QUICK);
    assert_eq!(service.result(&again).len() as f64, lit);
    let parts = sum(&metrics, "halflight_coordinator_bake_seconds_total");
    assert!(parts > 0.0, "the time of the bake is divided");
    assert_eq!(shown("uploads_received_bytes_total"), scene);
    assert_eq!(shown("results_sent_bytes_total"), 2.0 * lit);

    let noise = room.file("noise.glb", b"this is no glTF");
    assert!(!service.ask(&["submit", text(&noise), "--watch"]).success);
    let [running, queued] = [(); 2].map(|()| service.submit(&cornell(), &ENDLESS));
    assert_eq!((shown("jobs_running"), shown("jobs_queued")), (1.0, 1.0));
    let of_bakes = |name: &str| sum(&metrics, &format!("halflight_coordinator_{name}"));
    wait_for("the bake under way is shown", || {
        ["phase", "vertices", "rows_needed", "unshot_flux_ratio"].iter().all(|name| of_bakes(name) > 0.0)
    });
    assert_eq!(of_bakes("phase"), 1.0);
    assert_eq!((of_bakes("threads"), of_bakes("worker_threads")), (2.0, 2.0));
    assert!(of_bakes("worker_rows_total") > 0.0 && of_bakes("worker_busy_seconds_total") > 0.0);
    for job in [&queued, &running] {
        assert!(service.ask(&["cancel", job]).success);
    }
    wait_for("nothing runs", || shown("jobs_running") == 0.0);
    assert_eq!(shown("jobs_queued"), 0.0);
    for name in ["phase", "vertices", "rows_needed", "unshot_flux_ratio"] {
        assert_eq!(of_bakes(name), 0.0, "{name}");
    }
    assert_eq!(shown("jobs_submitted_total"), 5.0);
    for (state, count) in [("done", 2.0), ("failed", 1.0), ("cancelled", 2.0)] {
        assert_eq!(shown(&format!("jobs_ended_total{{state=\"{state}\"}}")), count, "{state}");
    }
    assert_eq!((shown("watchers"), shown("uploads")), (0.0, 0.0));
    assert!(shown("disk_free_bytes") > 0.0);
}
