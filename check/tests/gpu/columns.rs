use crate::common::scenes::{cloud, detect_with, settings, touching, verify};
use crate::common::{device, download, submit, upload};
use lazygrid::gpu::{
    BufferRange, ColumnLayout, GpuConfig, GpuDetector, GpuDevice, GpuSkinDetector, GpuSpheres, Outcome,
    SphereCount, wgpu,
};
use lazygrid::{Algorithm, Error, Interaction, Pair, Space, Sphere};
use lazygrid_check::{SpeciesSetup, TestInput};

fn layouts(spheres: &[Sphere]) -> Vec<(ColumnLayout, Vec<Vec<f32>>)> {
    let number = |sphere: &Sphere, column: usize| match column {
        3 => sphere.radius,
        axis => sphere.center[axis],
    };
    let arrays = (0..4).map(|column| spheres.iter().map(|sphere| number(sphere, column)).collect()).collect();
    let structure = ColumnLayout { first: [1, 7, 3, 8], stride: [9; 4] };
    let mut table = vec![f32::NAN; 9 * spheres.len()];
    for (row, sphere) in table.chunks_mut(9).zip(spheres) {
        for column in 0..4 {
            row[structure.first[column] as usize] = number(sphere, column);
        }
    }
    vec![(ColumnLayout::default(), arrays), (structure, vec![table])]
}

fn ranges(buffers: &[wgpu::Buffer]) -> [BufferRange<'_>; 4] {
    std::array::from_fn(|column| (&buffers[column % buffers.len()]).into())
}

fn uploaded(gpu: &GpuDevice, columns: &[Vec<f32>]) -> Vec<wgpu::Buffer> {
    columns.iter().map(|column| upload(gpu, column)).collect()
}

#[test]
fn columns_give_the_pairs_of_rows() {
    let Some(gpu) = device() else { return };
    let spheres = cloud(31, 3000, 12.0, |random| [0.4, 0.1][usize::from(random.unit() < 0.5)]);
    let space = Space::periodic([Some(11.0), None, Some(13.0)]).expect("a space");
    for (&algorithm, space) in
        Algorithm::GPU.iter().flat_map(|algorithm| [(algorithm, Space::UNBOUNDED), (algorithm, space)])
    {
        let settings = settings(algorithm, true).space(space);
        let mut rows = GpuDetector::new(&gpu.device, settings.clone()).expect("made");
        let wanted = detect_with(&gpu, &mut rows, &GpuSpheres::new(&upload(&gpu, &spheres), 3000)).pairs;
        assert!(wanted.len() > 1000, "{algorithm}: {}", wanted.len());
        for (layout, columns) in layouts(&spheres) {
            let mut detector = GpuDetector::new(&gpu.device, settings.clone().columns(layout)).expect("made");
            let buffers = uploaded(&gpu, &columns);
            for n in [3000, 257] {
                let count = upload(&gpu, &[n]);
                let count = SphereCount::Buffer { buffer: &count, at_most: 3000 };
                let found =
                    detect_with(&gpu, &mut detector, &GpuSpheres::from_columns(ranges(&buffers), count));
                let wanted: Vec<Pair> = wanted.iter().copied().filter(|pair| pair.j < n).collect();
                assert_eq!(found.pairs, wanted, "{algorithm}, {space:?}, {layout:?}, {n}");
                assert_eq!((found.outcome.spheres, found.outcome.overflow), (n, 0));
            }
        }
    }
}

#[test]
fn a_stride_of_zero_gives_all_spheres_one_radius() {
    let Some(gpu) = device() else { return };
    let spheres = cloud(32, 2000, 10.0, |_| 0.4);
    let mut columns = layouts(&spheres).swap_remove(0).1;
    columns[3].truncate(1);
    let layout = ColumnLayout { stride: [1, 1, 1, 0], ..ColumnLayout::default() };
    let config = settings(Algorithm::CellList, true).columns(layout);
    let mut detector = GpuDetector::new(&gpu.device, config).expect("made");
    let buffers = uploaded(&gpu, &columns);
    let found = detect_with(&gpu, &mut detector, &GpuSpheres::from_columns(ranges(&buffers), 2000));
    verify("one radius", &touching(&spheres), &found.pairs);
}

#[test]
fn columns_with_species_and_a_skin_give_the_pairs_of_rows() {
    let Some(gpu) = device() else { return };
    let mut spheres = cloud(33, 2000, 10.0, |random| [0.4, 0.2][usize::from(random.unit() < 0.5)]);
    let species: Vec<u32> = (0..2000).map(|k| k % 3).collect();
    let (never, touch, within) = (Interaction::Never, Interaction::Touch, Interaction::Within(0.9));
    let rows = vec![vec![never], vec![touch, never], vec![never, never, within]];
    let mixture = SpeciesSetup { species: species.clone(), rows };
    let table = mixture.interactions().expect("a table");
    let config = GpuConfig::default().algorithm(Algorithm::CellList).interactions(table);
    let buffers = uploaded(&gpu, &layouts(&spheres)[0].1);
    let species = upload(&gpu, &species);
    let mut detector =
        GpuSkinDetector::new(&gpu.device, config.columns(ColumnLayout::default()), 0.3).expect("made");
    for step in 0..4 {
        let input = GpuSpheres::from_columns(ranges(&buffers), 2000).with_species(&species);
        let output = submit(&gpu, |encoder| detector.encode(encoder, &input)).expect("recorded");
        let outcome = download::<Outcome>(&gpu, &output.outcome, 1)[0];
        assert_eq!(outcome.overflow, 0);
        let mut pairs: Vec<Pair> = download(&gpu, &output.pairs, outcome.found() as usize);
        pairs.sort_unstable();
        assert!(pairs.len() > 100, "{}", pairs.len());
        let input = TestInput { mixture: Some(mixture.clone()), ..touching(&spheres) };
        verify(&format!("step {step}"), &input, &pairs);
        spheres.iter_mut().for_each(|sphere| sphere.center.x += 0.1);
        let x: Vec<f32> = spheres.iter().map(|sphere| sphere.center.x).collect();
        gpu.queue.write_buffer(&buffers[0], 0, bytemuck::cast_slice(&x));
    }
}

#[test]
fn columns_that_do_not_fit_the_configuration_are_refused() {
    let Some(gpu) = device() else { return };
    let spheres = cloud(34, 100, 5.0, |_| 0.4);
    let (rows, columns) = (upload(&gpu, &spheres), uploaded(&gpu, &layouts(&spheres)[0].1));
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut refused = |config: GpuConfig, input: GpuSpheres<'_>| {
        let mut detector = GpuDetector::new(&gpu.device, config).expect("made");
        detector.encode(&mut encoder, &input).expect_err("refused")
    };
    let wide = ColumnLayout { stride: [2; 4], ..ColumnLayout::default() };
    let config = |layout: Option<ColumnLayout>| GpuConfig::default().columns(layout);
    let error = refused(config(None), GpuSpheres::from_columns(ranges(&columns), 100));
    assert!(matches!(error, Error::InvalidSetting { name: "sphere buffers", .. }), "{error}");
    let error = refused(config(Some(wide)), GpuSpheres::new(&rows, 100));
    assert!(matches!(error, Error::InvalidSetting { name: "sphere buffers", .. }), "{error}");
    let error = refused(config(Some(wide)), GpuSpheres::from_columns(ranges(&columns), 100));
    assert!(matches!(error, Error::BufferSize { needed: 796, size: 400, .. }), "{error}");
    let vast = ColumnLayout { first: [u32::MAX; 4], ..wide };
    let error = refused(config(Some(vast)), GpuSpheres::from_columns(ranges(&columns), 100));
    assert!(matches!(error, Error::BufferSize { .. } | Error::LimitExceeded { .. }), "{error}");
}
