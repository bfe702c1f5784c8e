//! Compute shaders: frames larger than the grid on a graphics processor, through `wgpu`.
//!
//! A frame goes to it as codes and comes back as codes. The averages come to the host, which
//! applies the operator with the runtime and gives the corrections back. All of it is
//! integers (`frame.wgsl`), and the results are those of [`FullFrames`](super::rows) bit for
//! bit.

use super::super::VideoError;
use super::super::bands::{Band, Bands, STRIP};
use super::super::curves::Curves;
use super::rows::{BAND_ROWS, expand};
use super::{EngineJob, OperatorMemory, correct};
use iltm_runtime::{
    image::Table,
    pipeline::FullPipeline,
    placement::PixelArea,
    units::{CORRECTION_GUARD_BITS, ClippedSamples, Drive},
};
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use rayon::ThreadPool;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, Buffer, BufferDescriptor, BufferUsages,
    CommandEncoder, CommandEncoderDescriptor, ComputePipeline, ComputePipelineDescriptor,
    DeviceDescriptor, DeviceType, Instance, InstanceDescriptor, MapMode,
    PipelineCompilationOptions, PollType, PowerPreference, RequestAdapterOptions, ShaderModule,
    include_wgsl,
};

/// Invocations of a workgroup, as the shader has it.
const GROUP: usize = 64;

/// Workgroups along a side that every graphics processor takes.
const GROUPS: usize = 65_535;

/// A graphics processor.
#[derive(Debug)]
pub(in super::super) struct Gpu {
    name: String,
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// The first that it said went wrong.
    fault: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// The most powerful one of this computer.
    ///
    /// # Errors
    /// [`VideoError::Gpu`] if there is none, or it cannot be used.
    pub(in super::super) fn find() -> Result<Self, VideoError> {
        let instance = Instance::new(InstanceDescriptor::new_without_display_handle_from_env());
        let options = RequestAdapterOptions {
            power_preference: PowerPreference::HighPerformance,
            ..RequestAdapterOptions::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(failed)?;
        let device = pollster::block_on(adapter.request_device(&DeviceDescriptor {
            required_limits: adapter.limits(),
            ..DeviceDescriptor::default()
        }));
        let (device, queue) = device.map_err(failed)?;
        let fault = Arc::new(Mutex::new(None));
        let first = Arc::clone(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut first = first.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert(error.to_string());
        }));
        let info = adapter.get_info();
        let kind = match info.device_type {
            DeviceType::Cpu => ", software on the processor",
            _ => "",
        };
        Ok(Self {
            name: format!("{}{kind}", info.name),
            device,
            queue,
            fault,
        })
    }

    /// What it is called, and whether it is none but software.
    pub(in super::super) fn name(&self) -> &str {
        &self.name
    }

    /// Memory with this content.
    fn filled(&self, content: &[u8]) -> Result<Buffer, VideoError> {
        self.holds(content.len())?;
        Ok(self.device.create_buffer_init(&BufferInitDescriptor {
            label: None,
            contents: content,
            usage: BufferUsages::STORAGE,
        }))
    }

    /// Memory for so many bytes that the shader works on.
    fn working(&self, bytes: usize) -> Result<Buffer, VideoError> {
        self.holds(bytes)?;
        let copied = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        Ok(self.buffer(bytes, BufferUsages::STORAGE | copied))
    }

    fn buffer(&self, bytes: usize, usage: BufferUsages) -> Buffer {
        self.device.create_buffer(&BufferDescriptor {
            label: None,
            size: bytes as u64,
            usage,
            mapped_at_creation: false,
        })
    }

    fn holds(&self, bytes: usize) -> Result<(), VideoError> {
        let most = self.device.limits().max_storage_buffer_binding_size;
        if bytes as u64 <= most {
            return Ok(());
        }
        let millions = |bytes: u64| bytes.div_ceil(1_000_000);
        Err(failed(format!(
            "frames of this size need {} MB in one piece, {} has room for {}",
            millions(bytes as u64),
            self.name,
            millions(most)
        )))
    }

    /// Has the commands done.
    ///
    /// # Errors
    /// [`VideoError::Gpu`] if anything went wrong since this was asked last.
    fn run(&self, commands: CommandEncoder) -> Result<(), VideoError> {
        self.queue.submit([commands.finish()]);
        let waited = self.device.poll(PollType::wait_indefinitely());
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        match fault.take() {
            Some(fault) => Err(failed(fault)),
            None => waited.map(|_| ()).map_err(failed),
        }
    }
}

#[allow(clippy::needless_pass_by_value, reason = "`map_err` gives a value")]
fn failed(reason: impl ToString) -> VideoError {
    VideoError::Gpu {
        reason: reason.to_string(),
    }
}

/// Memory of the shader and what of it is copied to the host.
struct Shared {
    working: Buffer,
    host: Buffer,
}

impl Shared {
    fn new(gpu: &Gpu, bytes: usize) -> Result<Self, VideoError> {
        Ok(Self {
            working: gpu.working(bytes)?,
            host: gpu.buffer(bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST),
        })
    }

    fn copy(&self, commands: &mut CommandEncoder) {
        commands.copy_buffer_to_buffer(&self.working, 0, &self.host, 0, self.host.size());
    }

    /// What [`copy`](Self::copy) copied.
    fn read(&self, gpu: &Gpu, to: &mut [u8]) -> Result<(), VideoError> {
        let mapped = Arc::new(Mutex::new(Ok(())));
        let result = Arc::clone(&mapped);
        self.host.map_async(MapMode::Read, .., move |mapped| {
            *result.lock().unwrap_or_else(PoisonError::into_inner) = mapped;
        });
        gpu.device
            .poll(PollType::wait_indefinitely())
            .map_err(failed)?;
        let mut mapped = mapped.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::replace(&mut *mapped, Ok(())).map_err(failed)?;
        {
            let bytes = self.host.get_mapped_range(..).map_err(failed)?;
            to.copy_from_slice(&bytes[..to.len()]);
        }
        self.host.unmap();
        Ok(())
    }
}

/// An entry point of the shader with the memory that it uses.
struct Pass {
    pipeline: ComputePipeline,
    memory: BindGroup,
    groups: usize,
}

impl Pass {
    fn new(
        gpu: &Gpu,
        (shader, constants): (&ShaderModule, &[(&str, f64)]),
        entry: &str,
        invocations: usize,
        buffers: &[(u32, &Buffer)],
    ) -> Self {
        let pipeline = gpu
            .device
            .create_compute_pipeline(&ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: shader,
                entry_point: Some(entry),
                compilation_options: PipelineCompilationOptions {
                    constants,
                    ..PipelineCompilationOptions::default()
                },
                cache: None,
            });
        let entries: Vec<_> = buffers
            .iter()
            .map(|(binding, buffer)| BindGroupEntry {
                binding: *binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let memory = gpu.device.create_bind_group(&BindGroupDescriptor {
            label: Some(entry),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Self {
            pipeline,
            memory,
            groups: invocations.div_ceil(GROUP),
        }
    }

    fn add(&self, commands: &mut CommandEncoder) {
        let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.memory, &[]);
        let rows = self.groups.div_ceil(GROUPS);
        pass.dispatch_workgroups(self.groups.div_ceil(rows) as u32, rows as u32, 1);
    }
}

/// Compensates frames larger than the grid.
pub(super) struct GpuFrames<'t, 'a, P: Bands, const C: usize> {
    gpu: Arc<Gpu>,
    pipeline: FullPipeline<'t, 'a, C>,
    threads: &'t ThreadPool,
    row_len: usize,
    samples: usize,
    /// Row by row, in a row colour by colour; whole words of them.
    codes: Vec<P::Code>,
    /// Of the cells, colour by colour.
    sums: Vec<u64>,
    /// Of the cells, colour by colour.
    corrections: Vec<i32>,
    average_rows: Pass,
    average: Pass,
    interpolate: Pass,
    finish: Pass,
    gpu_codes: Shared,
    gpu_sums: Shared,
    gpu_corrections: Buffer,
    gpu_clipped: Shared,
}

impl<'t, 'a, P: Bands, const C: usize> GpuFrames<'t, 'a, P, C> {
    pub(super) fn new(
        table: &'t Table<'a>,
        gpu: &Arc<Gpu>,
        threads: &'t ThreadPool,
        job: &EngineJob,
    ) -> Result<Self, VideoError> {
        let pipeline = FullPipeline::<C>::within(table, job.size, job.area);
        let pipeline = pipeline.map_err(VideoError::Runtime)?;
        let curves = Curves::<P::Code>::new(table, job.encoding);
        let (cells, cols) = (table.grid().cells(), table.grid().cols());
        let [rows, columns] = pipeline.cell_axes();
        let PixelArea { size: area, .. } = job.area;
        let per_word = size_of::<u32>() / size_of::<P::Code>();
        let words = job.samples().div_ceil(per_word);
        let lines = area.height() * job.colours * (cols + 1);

        let places = (0..area.height()).flat_map(|y| {
            let place = rows.place(y);
            [place.before as u32, place.after as u32, place.fraction, 0]
        });
        let pieces: Vec<_> = columns.pieces().collect();
        let starts = pieces
            .iter()
            .flat_map(|piece| [piece.first as u32, piece.past]);
        let of_columns =
            (0..area.width()).map(|x| pieces.partition_point(|piece| piece.first <= x) as u32);
        let words_of = |values: Vec<u32>| gpu.filled(cast_slice(&values));
        let light_by_code = words_of(curves.light_words())?;
        let (code_by_drive, code_curves) = curves.code_words();
        let code_by_drive = words_of(code_by_drive)?;
        let paint = words_of(threads.install(|| paint(&pipeline)))?;
        let places = words_of(places.collect())?;
        let starts = words_of(starts.collect())?;
        let of_columns = words_of(of_columns.collect())?;
        let gpu_lines = gpu.working(lines * size_of::<[i32; 2]>())?;
        let gpu_codes = Shared::new(gpu, words * size_of::<u32>())?;
        let row_sums = area.height() * job.colours * cols;
        let gpu_row_sums = gpu.working(row_sums * size_of::<u32>())?;
        let gpu_sums = Shared::new(gpu, cells * job.colours * size_of::<u64>())?;
        let gpu_corrections = gpu.working(cells * job.colours * size_of::<i32>())?;
        let gpu_clipped = Shared::new(gpu, size_of::<[u32; 2]>())?;

        let shader = gpu.device.create_shader_module(include_wgsl!("frame.wgsl"));
        let constants = overrides::<P::Code, C>(&pipeline, job, code_curves);
        let pass = |entry, invocations, buffers: &[_]| {
            Pass::new(gpu, (&shader, &constants), entry, invocations, buffers)
        };
        Ok(Self {
            average_rows: pass(
                "average_rows",
                row_sums,
                &[
                    (0, &gpu_codes.working),
                    (1, &light_by_code),
                    (2, &paint),
                    (11, &gpu_row_sums),
                ],
            ),
            average: pass(
                "average",
                cells * job.colours,
                &[(3, &gpu_sums.working), (11, &gpu_row_sums)],
            ),
            interpolate: pass(
                "interpolate",
                lines,
                &[
                    (4, &gpu_corrections),
                    (5, &places),
                    (6, &starts),
                    (7, &gpu_lines),
                ],
            ),
            finish: pass(
                "finish",
                words,
                &[
                    (0, &gpu_codes.working),
                    (1, &light_by_code),
                    (2, &paint),
                    (7, &gpu_lines),
                    (8, &of_columns),
                    (9, &code_by_drive),
                    (10, &gpu_clipped.working),
                ],
            ),
            gpu: Arc::clone(gpu),
            pipeline,
            threads,
            row_len: job.size.width() * job.colours,
            samples: job.samples(),
            codes: vec![P::Code::default(); words * per_word],
            sums: vec![0; cells * job.colours],
            corrections: vec![0; cells * job.colours],
            gpu_codes,
            gpu_sums,
            gpu_corrections,
            gpu_clipped,
        })
    }

    /// Compensates a frame in place; returns how many samples were clipped.
    pub(super) fn compensate(
        &mut self,
        job: &EngineJob,
        operator: &mut OperatorMemory,
        frame: &mut P,
    ) -> Result<ClippedSamples, VideoError> {
        let gpu = Arc::clone(&self.gpu);
        self.unpack(frame);
        let queue = &gpu.queue;
        queue.write_buffer(&self.gpu_codes.working, 0, cast_slice(&self.codes));
        if self.pipeline.operates(job.tier) {
            let mut commands = gpu
                .device
                .create_command_encoder(&CommandEncoderDescriptor::default());
            self.average_rows.add(&mut commands);
            self.average.add(&mut commands);
            self.gpu_sums.copy(&mut commands);
            gpu.run(commands)?;
            self.gpu_sums.read(&gpu, cast_slice_mut(&mut self.sums))?;
        }
        let (sums, corrections) = (&self.sums, &mut self.corrections);
        correct(&self.pipeline, job.tier, sums, corrections, operator)
            .map_err(VideoError::Runtime)?;
        queue.write_buffer(&self.gpu_corrections, 0, cast_slice(&self.corrections));
        let mut commands = gpu
            .device
            .create_command_encoder(&CommandEncoderDescriptor::default());
        commands.clear_buffer(&self.gpu_clipped.working, 0, None);
        self.interpolate.add(&mut commands);
        self.finish.add(&mut commands);
        self.gpu_codes.copy(&mut commands);
        self.gpu_clipped.copy(&mut commands);
        gpu.run(commands)?;
        let mut clipped = [0_u32; 2];
        self.gpu_clipped.read(&gpu, cast_slice_mut(&mut clipped))?;
        self.gpu_codes.read(&gpu, cast_slice_mut(&mut self.codes))?;
        self.pack(frame);
        let [black, white] = clipped;
        Ok(ClippedSamples { black, white })
    }

    fn unpack(&mut self, frame: &mut P) {
        let strip_len = STRIP * self.row_len;
        let codes = self.codes[..self.samples].par_chunks_mut(BAND_ROWS * self.row_len);
        self.threads.install(|| {
            let bands = frame.bands(BAND_ROWS).into_par_iter().zip(codes);
            bands.for_each_init(P::Memory::default, |memory, (band, codes)| {
                for strip in 0..band.rows().div_ceil(STRIP) {
                    let rest = &mut codes[strip * strip_len..];
                    let len = strip_len.min(rest.len());
                    band.unpack(strip, memory, &mut rest[..len]);
                }
            });
        });
    }

    fn pack(&self, frame: &mut P) {
        let strip_len = STRIP * self.row_len;
        let codes = self.codes[..self.samples].par_chunks(BAND_ROWS * self.row_len);
        self.threads.install(|| {
            let bands = frame.bands(BAND_ROWS).into_par_iter().zip(codes);
            bands.for_each_init(P::Memory::default, |memory, (mut band, codes)| {
                for strip in 0..band.rows().div_ceil(STRIP) {
                    let rest = &codes[strip * strip_len..];
                    band.pack(strip, memory, &rest[..strip_len.min(rest.len())]);
                }
            });
        });
    }
}

/// Gain of every pixel and channel of the area, and ambient light above it.
fn paint<const C: usize>(pipeline: &FullPipeline<'_, '_, C>) -> Vec<u32> {
    let (gains, ambient) = expand(pipeline);
    let mut paint: Vec<_> = gains.iter().copied().map(u32::from).collect();
    for (paint, ambient) in paint.iter_mut().zip(&ambient) {
        *paint |= u32::from(*ambient) << 16;
    }
    paint
}

/// What the shader calls overrides.
fn overrides<S, const C: usize>(
    pipeline: &FullPipeline<'_, '_, C>,
    job: &EngineJob,
    code_curves: usize,
) -> Vec<(&'static str, f64)> {
    let table = pipeline.table();
    let PixelArea { left, top, size } = job.area;
    let [[from, to], [from_row, to_row]] = job.picture;
    let [_, columns] = pipeline.cell_axes();
    let values = [
        ("WIDTH", job.size.width()),
        ("COLOURS", job.colours),
        ("CHANNELS", C),
        ("CODE_BITS", 8 * size_of::<S>()),
        ("AREA_LEFT", left),
        ("AREA_TOP", top),
        ("AREA_WIDTH", size.width()),
        ("AREA_HEIGHT", size.height()),
        ("PICTURE_LEFT", from),
        ("PICTURE_RIGHT", to),
        ("PICTURE_TOP", from_row),
        ("PICTURE_BOTTOM", to_row),
        ("ROWS", table.grid().rows()),
        ("COLS", table.grid().cols()),
        ("STEP", columns.step() as u32 as usize),
        ("GAIN_FRACTION", table.gain_fraction().into()),
        ("CORRECTION_GUARD_BITS", CORRECTION_GUARD_BITS as usize),
        ("DRIVE_ONE", Drive::ONE.to_bits().into()),
        ("CURVES", code_curves),
    ];
    values.map(|(name, value)| (name, value as f64)).into()
}
