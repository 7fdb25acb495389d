use std::fs;
use std::net::TcpListener;

use protocol::security::TlsFiles;
use tests::certificates::{Authority, arguments};
use tests::programs::WorkerProcess;
use tests::service::{Said, ServiceProcess};

use super::{QUICK, Room, cornell, text, wait_for};
use crate::telemetry::figures;

/// A service and its worker, whose certificates can be replaced.
struct Encrypted {
    service: ServiceProcess,
    worker: WorkerProcess,
    metrics: String,
    /// Files of the service towards clients and workers, and of the worker.
    ends: [TlsFiles; 3],
}

impl Encrypted {
    fn start(room: &Room, authority: &Authority) -> Self {
        let metrics = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
        let ends = files(authority);
        let worker = worker("127.0.0.1:0", &ends[2]);
        let [_, ca, _, certificate, _, key] = arguments(&ends[0]);
        let listening = ["--listen-tls-ca", ca, "--listen-tls-cert", certificate, "--listen-tls-key", key];
        let others = ["--workers", &worker.address, "--metrics", &metrics];
        let service = room.start(&[&listening[..], &arguments(&ends[1]), &others].concat());
        let encrypted = Self { service, worker, metrics, ends };
        encrypted.wait_for_worker();
        encrypted
    }

    fn figure(&self, name: &str) -> f64 {
        figures(&self.metrics).unwrap()[&format!("halflight_coordinator_{name}")]
    }

    fn wait_for_worker(&self) {
        wait_for("a session with the worker", || self.figure("workers") == 1.0);
    }

    /// Writes files of this authority over those of all ends.
    fn renew(&self, authority: &Authority) {
        for (end, renewed) in self.ends.iter().zip(files(authority)) {
            for (file, by) in
                [(&end.certificate, renewed.certificate), (&end.key, renewed.key), (&end.ca, renewed.ca)]
            {
                fs::copy(by, file).unwrap();
            }
        }
    }

    fn ask(&self, words: &[&str], client: &TlsFiles) -> Said {
        self.service.ask(&[words, &arguments(client)].concat())
    }

    /// Bakes a scene as this client.
    fn bake(&self, room: &Room, scene: &str, client: &TlsFiles) {
        let (scene, lit) = (tests::data(scene), room.folder.path().join("lit.glb"));
        let said = self.ask(&[&["submit", text(&scene), "-o", text(&lit)], &QUICK[..]].concat(), client);
        assert!(said.success, "{}", said.errors);
    }
}

fn files(authority: &Authority) -> [TlsFiles; 3] {
    [&["127.0.0.1"], &["coordinator"], &["127.0.0.1"]].map(|names| authority.sign(names))
}

fn worker(address: &str, files: &TlsFiles) -> WorkerProcess {
    WorkerProcess::start_at(address, 1, &arguments(files))
}

/// Nothing is restarted, and no connection ends: both ends take the new files for new connections.
#[test]
fn changed_certificates_count_for_new_connections() {
    let (room, former, renewed) = (Room::new(), Authority::new(), Authority::new());
    let mut encrypted = Encrypted::start(&room, &former);
    let (known, unknown) = (former.sign(&["ann"]), renewed.sign(&["ann"]));
    encrypted.bake(&room, "scenes/cornell.glb", &known);
    assert!(!encrypted.ask(&["jobs"], &unknown).success);

    encrypted.renew(&renewed);
    let refused = encrypted.ask(&["jobs"], &known);
    assert!(!refused.success && refused.errors.contains("not of the authority"), "{}", refused.errors);
    // Rows are of another scene, which the worker has not got.
    encrypted.bake(&room, "scenes/table.glb", &unknown);
    assert_eq!(encrypted.figure("lost_workers_total"), 0.0, "a live connection was dropped");

    // A worker that restarts is dialled with the new certificate.
    encrypted.worker.kill();
    wait_for("the loss of the worker", || encrypted.figure("workers") == 0.0);
    let _again = worker(&encrypted.worker.address, &encrypted.ends[2]);
    encrypted.wait_for_worker();
    encrypted.bake(&room, "scenes/cornell.glb", &unknown);
}

/// The connection for uploads begins with the first of them.
#[test]
fn a_worker_that_had_no_job_before_gets_its_first_replica() {
    let (room, former, renewed) = (Room::new(), Authority::new(), Authority::new());
    let encrypted = Encrypted::start(&room, &former);
    encrypted.renew(&renewed);
    encrypted.bake(&room, "scenes/cornell.glb", &renewed.sign(&["ann"]));
    assert_eq!(encrypted.figure("lost_workers_total"), 0.0, "a live connection was dropped");
}

/// While files are being replaced, key and certificate may not fit.
#[test]
fn files_that_do_not_fit_are_not_taken() {
    let (room, authority) = (Room::new(), Authority::new());
    let encrypted = Encrypted::start(&room, &authority);
    let (client, listening) = (authority.sign(&["ann"]), &encrypted.ends[0]);
    let other = authority.sign(&["127.0.0.1"]);
    fs::copy(&other.key, &listening.key).unwrap();
    assert!(encrypted.ask(&["jobs"], &client).success, "the former ones are forgotten");
    fs::remove_file(&listening.ca).unwrap();
    assert!(encrypted.ask(&["jobs"], &client).success, "the former ones are forgotten");
    fs::copy(&other.certificate, &listening.certificate).unwrap();
    fs::copy(&other.ca, &listening.ca).unwrap();
    encrypted.bake(&room, text(&cornell()), &client);
}
