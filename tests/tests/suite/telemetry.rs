//! What is seen of running programs, against what they did.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;
use tests::builder::{Material, SceneBuilder};
use tests::programs::{Solving, WorkerProcess, binary};
use tests::shapes;
use tonic::Request;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
use tonic_reflection::pb::v1::{ServerReflectionRequest, ServerReflectionResponse};

/// Far above what any of this takes: only what hangs ends here.
const HANGS: Duration = Duration::from_secs(60);

/// The figures at `/metrics`, by name and labels. Lines that are not OpenMetrics text fail the test.
pub fn figures(address: &str) -> Option<HashMap<String, f64>> {
    let mut socket = TcpStream::connect(address).ok()?;
    socket.set_read_timeout(Some(HANGS)).unwrap();
    write!(socket, "GET /metrics HTTP/1.1\r\nHost: test\r\n\r\n").ok()?;
    let mut answer = String::new();
    socket.read_to_string(&mut answer).ok()?;
    let (head, body) = answer.split_once("\r\n\r\n")?;
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("application/openmetrics-text"), "{head}");
    let body = body.strip_suffix("# EOF\n").unwrap_or_else(|| panic!("no end in {body}"));
    let mut figures = HashMap::new();
    for line in body.lines() {
        if let Some(comment) = line.strip_prefix("# ") {
            let kind = comment.split(' ').next().unwrap();
            assert!(["HELP", "TYPE", "UNIT"].contains(&kind), "{line}");
        } else {
            let (name, value) = line.rsplit_once(' ').unwrap_or_else(|| panic!("no figure in {line:?}"));
            figures.insert(name.to_owned(), value.parse().unwrap());
        }
    }
    Some(figures)
}

/// A worker that logs objects and shows figures; ends when dropped.
struct Shown {
    child: Child,
    address: String,
    metrics: String,
}

impl Shown {
    fn start() -> Self {
        let mut child = Command::new(binary("worker"))
            .args(["--listen", "127.0.0.1:0", "--threads", "2", "--name", "shown"])
            .args(["--metrics", "127.0.0.1:0", "--log", "json"])
            .env("RUST_LOG", "info")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.split(' ').nth(4).unwrap().to_owned();
        let mut logs = BufReader::new(child.stderr.take().unwrap());
        let metrics = loop {
            let mut line = String::new();
            logs.read_line(&mut line).unwrap();
            let object: serde_json::Value = serde_json::from_str(&line).unwrap();
            assert!(object["timestamp"].is_string() && object["level"] == "INFO", "{line}");
            if object["message"] == "metrics" {
                break object["address"].as_str().unwrap().to_owned();
            }
        };
        // Somebody must read what it goes on to say.
        std::thread::spawn(move || std::io::copy(&mut logs, &mut std::io::sink()));
        Self { child, address, metrics }
    }
}

impl Drop for Shown {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn room() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("room.glb");
    let room = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0));
    std::fs::write(&scene, room.glb()).unwrap();
    (folder, scene)
}

#[test]
fn a_worker_shows_what_the_coordinator_reports() {
    let worker = Shown::start();
    let (_folder, scene) = room();
    let solved = Solving::start(&scene, &["--workers", &worker.address]).finish();
    assert!(solved.success, "{}", solved.said);
    let told = &solved.report["workers"][0];
    // The session ends a moment after the coordinator.
    let begun = Instant::now();
    let shown = loop {
        let shown = figures(&worker.metrics).unwrap();
        if shown["halflight_worker_sessions"] == 0.0 {
            break shown;
        }
        assert!(begun.elapsed() < HANGS, "the session does not end");
        std::thread::sleep(Duration::from_millis(20));
    };
    let shown = |name: &str| shown[&format!("halflight_worker_{name}")];
    for (name, field) in [("jobs_total", "jobs"), ("rows_total", "rows"), ("rays_total", "rays")] {
        assert_eq!(shown(name), told[field].as_f64().unwrap(), "{name}");
    }
    assert!(shown("rows_total") > 0.0);
    assert_eq!(shown("rows_sent_bytes_total"), told["bytes_received"].as_f64().unwrap());
    let busy = told["busy_seconds"].as_f64().unwrap();
    assert!((shown("busy_seconds_total") - busy).abs() <= 1e-6 * busy, "busy");
    assert!(shown("uploads_total") >= 2.0 && shown("upload_failures_total") == 0.0);
    assert_eq!((shown("jobs_queued"), shown("jobs_computing")), (0.0, 0.0));
}

/// Asserts that a report says what the whole wall time went to.
pub fn assert_parts_sum_up(report: &serde_json::Value) {
    let time = &report["time"];
    let part = |name: &str| time[name].as_f64().unwrap_or_else(|| panic!("{name} in {time}"));
    let parts = ["rows", "other_rows", "network", "waiting", "own"].map(part);
    let seconds = report["seconds"].as_f64().unwrap();
    assert!(parts.iter().all(|part| *part >= 0.0) && parts[0] > 0.0, "{time}");
    assert!((parts.iter().sum::<f64>() - seconds).abs() < 1e-3 * seconds, "{time} in {seconds} s");
    let steps: f64 = time["own_steps"].as_array().unwrap().iter().map(|step| step[1].as_f64().unwrap()).sum();
    assert!((steps - parts[4]).abs() < 1e-3 * seconds, "{time}");
}

#[test]
fn a_coordinator_shows_a_bake_under_way() {
    let worker = WorkerProcess::start(1);
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let metrics = port.to_string();
    let mut solving = Solving::start(
        &tests::data("scenes/cornell.glb"),
        &["--workers", &worker.address, "--metrics", &metrics, "--mesh-error", "0.01"],
    );
    // Its first line is about its progress: the bake is under way.
    solving.wait_for("rows");
    let begun = Instant::now();
    let phases = |figures: &HashMap<String, f64>| -> f64 {
        figures.iter().filter(|(name, _)| name.contains("_phase{")).map(|(_, on)| on).sum()
    };
    let mut last = figures(&metrics).unwrap();
    let mut under_way = last.clone();
    let mut workers = 0.0_f64;
    loop {
        assert!(begun.elapsed() < HANGS, "no rows, or no end");
        let Some(now) = figures(&metrics) else { break };
        for (name, value) in &now {
            assert!(!name.ends_with("_total") || *value >= last[name], "{name} falls");
        }
        last = now;
        if phases(&last) > 0.0 {
            under_way = last.clone();
        }
        // It leaves before the coordinator ends.
        workers = workers.max(last["halflight_coordinator_workers"]);
    }
    let solved = solving.finish();
    assert!(solved.success, "{}", solved.said);
    let shown = |name: &str| last[&format!("halflight_coordinator_{name}")];
    let told = &solved.report["workers"][0];
    assert_eq!(workers, 1.0);
    assert_parts_sum_up(&solved.report);
    let of_bake = |part: &str| shown(&format!("bake_seconds_total{{part=\"{part}\"}}"));
    let time = &solved.report["time"];
    assert!(of_bake("rows") > 0.0 && of_bake("rows") <= solved.report["seconds"].as_f64().unwrap(), "{time}");
    assert!(shown("rows_total") > 0.0 && shown("rows_total") <= told["rows"].as_f64().unwrap());
    assert!(shown("received_bytes_total") > 0.0 && shown("sent_bytes_total") > 0.0);
    // It ends before the coordinator does.
    let of_bake = |name: &str| under_way[&format!("halflight_coordinator_{name}")];
    assert!(of_bake("vertices") > 0.0 && of_bake("unshot_flux_ratio").is_finite());
    assert_eq!(phases(&under_way), 1.0);
    assert_eq!(shown("lost_workers_total"), 0.0);
}

#[test]
fn health_and_reflection_are_on_the_workers_port() {
    let mut worker = WorkerProcess::start(1);
    let health = |address: &str| {
        let output = Command::new(binary("worker")).args(["--health", address]).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    assert_eq!(health(&worker.address), (Some(0), String::new()));

    let runtime = tokio::runtime::Runtime::new().unwrap();
    let services = runtime.block_on(async {
        let channel = tonic::transport::Channel::from_shared(format!("http://{}", worker.address)).unwrap();
        let mut client = ServerReflectionClient::new(channel.connect().await.unwrap());
        let ask = ServerReflectionRequest {
            message_request: Some(MessageRequest::ListServices(String::new())),
            ..ServerReflectionRequest::default()
        };
        let answers = client.server_reflection_info(Request::new(tokio_stream::iter([ask]))).await.unwrap();
        let answer: ServerReflectionResponse = answers.into_inner().message().await.unwrap().unwrap();
        let Some(MessageResponse::ListServicesResponse(list)) = answer.message_response else {
            panic!("no list")
        };
        list.service.into_iter().map(|service| service.name).collect::<Vec<_>>()
    });
    for name in ["radiosity.worker.v1.Worker", "grpc.health.v1.Health"] {
        assert!(services.iter().any(|found| found == name), "{name} is missing in {services:?}");
    }
    worker.kill();
    let (code, said) = health(&worker.address);
    assert!(code == Some(1) && said.contains(&worker.address), "{said}");
}
