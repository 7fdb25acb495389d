//! Import and export of a scene: cornell as it comes, and with the mesh of a bake.

use std::fs;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Duration;

use bake::{BakeSettings, Unobserved, bake};
use cluster::{Cluster, Workers};
use criterion::{Criterion, criterion_group, criterion_main};
use output::export::{ExportSettings, export};
use scene::{ImportOptions, import_slice};

fn files(criterion: &mut Criterion) {
    let cornell = fs::read(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/scenes/cornell.glb"))
        .expect("the repository has tests/scenes/cornell.glb");
    let options = ImportOptions::default();
    let scene = import_slice(&cornell, &options).expect("cornell can be imported");
    let cluster = Cluster::start(&Workers::Embedded { threads: 2 }.into()).expect("threads can be started");
    let baked = bake(&scene, &BakeSettings::for_error(0.03), &mut cluster.handle(0), &mut Unobserved)
        .expect("cornell can be baked");
    cluster.shutdown();
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join("lit.glb");
    let settings = ExportSettings::default();
    let write = || export(&scene, &baked.lit, &settings, &path).expect("the folder can be written");
    let exported = write();
    let lit = fs::read(&path).expect("the file was written");

    let mut group = criterion.benchmark_group("files");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2)).sample_size(20);
    group
        .bench_function("import cornell", |bench| bench.iter(|| import_slice(black_box(&cornell), &options)));
    group.bench_function(format!("import {} triangles", exported.triangles), |bench| {
        bench.iter(|| import_slice(black_box(&lit), &options));
    });
    group.bench_function(format!("export {} triangles", exported.triangles), |bench| bench.iter(write));
    group.finish();
}

criterion_group!(benches, files);
criterion_main!(benches);
