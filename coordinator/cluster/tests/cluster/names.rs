//! A name that stands for several machines, and for others later.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use cluster::{AsyncCluster, ClusterSettings, JobId, Workers};
use protocol::network::{Answer, ByteStream, Network, Sockets};

use super::bakery::Bakery;
use super::server::Server;

/// A name server that is told what to say; connections are sockets.
#[derive(Default)]
struct Names(Mutex<Vec<SocketAddr>>);

impl Names {
    fn say(&self, servers: &[&Server]) {
        *self.0.lock().unwrap() = servers.iter().map(|server| server.address.parse().unwrap()).collect();
    }
}

impl Network for Names {
    fn resolve(&self, name: &str) -> Answer<Vec<SocketAddr>> {
        assert_eq!(name, "workers:7070");
        let addresses = self.0.lock().unwrap().clone();
        Box::pin(async move { Ok(addresses) })
    }

    fn connect(&self, address: SocketAddr) -> Answer<Box<dyn ByteStream>> {
        Sockets.connect(address)
    }
}

/// Waits until `count` workers are connected.
async fn connected(cluster: &AsyncCluster, count: usize) {
    loop {
        let (workers, _) = cluster.summarise().await;
        if workers.iter().filter(|worker| worker.lost.is_none()).count() == count {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[test]
fn a_name_is_followed() {
    // Each has a runtime of its own, and so has the cluster.
    let servers = [Server::real(), Server::real(), Server::real()];
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(follow(&servers));
}

async fn follow(servers: &[Server; 3]) {
    let names = Arc::new(Names::default());
    names.say(&[&servers[0], &servers[1]]);
    let settings: ClusterSettings = Workers::Remote(vec!["workers:7070".into()]).into();
    let mut cluster = AsyncCluster::start(&settings, names.clone()).await.unwrap();
    connected(&cluster, 2).await;

    // One more machine, one less: the new one is found, and the old one goes on as long as it lives.
    names.say(&[&servers[1], &servers[2]]);
    connected(&cluster, 3).await;
    let bakery = Bakery::new();
    bakery.replicas().into_iter().for_each(|replica| cluster.publish(replica));
    cluster.submit((0..).map(JobId).zip(bakery.requests()).collect());
    let expected = bakery.rows();
    for _ in 0..expected.len() {
        let finished = cluster.next().await.unwrap();
        assert_eq!(finished.rows, expected[&finished.job.0]);
    }

    // Once it has ended, it is not looked for any more; one that is listed is.
    servers[0].stop();
    connected(&cluster, 2).await;
    tokio::time::sleep(Duration::from_secs(1)).await;
    let (workers, _) = cluster.summarise().await;
    let lost: Vec<&str> = workers
        .iter()
        .filter(|worker| worker.lost.is_some())
        .map(|worker| worker.part.address.as_str())
        .collect();
    assert_eq!(lost, [format!("workers:7070 ({})", servers[0].address)]);
    cluster.leave().await;
}
