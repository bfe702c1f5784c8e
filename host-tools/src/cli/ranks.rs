//! MPI: the ranks of `mpirun iltm solve`.
//!
//! Rank 0 is the command; the others help it to solve. A rank that dies is noticed by `mpirun`,
//! which ends all of them.

use super::failure::{Failure, Kind};
use crate::solve::Processes;
use std::env;
use std::process::ExitCode;

/// How many ranks `mpirun` started, in the environment of each.
const COUNT: &str = "OMPI_COMM_WORLD_SIZE";

/// This process among those that MPI started.
pub(super) struct Ranks {
    processes: Processes,
    #[cfg(feature = "mpi")]
    universe: Option<std::mem::ManuallyDrop<mpi::environment::Universe>>,
}

#[cfg(not(feature = "mpi"))]
impl Ranks {
    /// Joins the others.
    pub(super) fn join() -> Result<Self, Failure> {
        let count = env::var(COUNT).ok().and_then(|count| count.parse().ok());
        match count {
            Some(2_usize..) => Err(Failure::new(
                Kind::Usage,
                "this iltm was built without MPI: all ranks would do the same",
                "Build it with `cargo build --release --features mpi`, or run it without mpirun.",
            )),
            _ => Ok(Self {
                processes: Processes::default(),
            }),
        }
    }

    /// Runs the command.
    pub(super) fn run(self, command: impl FnOnce(Processes) -> ExitCode) -> ExitCode {
        command(self.processes)
    }
}

#[cfg(feature = "mpi")]
impl Ranks {
    /// Joins the others.
    pub(super) fn join() -> Result<Self, Failure> {
        /// What Open MPI, `PMIx` (as `srun` starts it) and MPICH set.
        const STARTED: [&str; 3] = [COUNT, "PMIX_RANK", "PMI_RANK"];
        if STARTED.iter().all(|name| env::var_os(name).is_none()) {
            return Ok(Self {
                processes: Processes::default(),
                universe: None,
            });
        }
        // The thread that waits for ctrl-C calls nothing of MPI.
        let joined = mpi::initialize_with_threading(mpi::Threading::Funneled);
        let (universe, _) = joined.ok_or_else(|| {
            let next_step = "Run it without mpirun, or see what mpirun says.";
            Failure::new(Kind::Usage, "MPI cannot be started", next_step)
        })?;
        Ok(Self {
            processes: Processes::new(&world::World),
            // A rank that panics does not say good-bye: it would wait for the others forever.
            universe: Some(std::mem::ManuallyDrop::new(universe)),
        })
    }

    /// Runs the command on rank 0; the others help.
    pub(super) fn run(self, command: impl FnOnce(Processes) -> ExitCode) -> ExitCode {
        let code = if self.processes.is_first() {
            let code = command(self.processes);
            self.processes.dismiss();
            code
        } else {
            self.processes.help();
            ExitCode::SUCCESS
        };
        drop(self.universe.map(std::mem::ManuallyDrop::into_inner));
        code
    }
}

#[cfg(feature = "mpi")]
mod world {
    use crate::solve::Group;
    use mpi::topology::SimpleCommunicator;
    use mpi::traits::{Communicator, CommunicatorCollectives, Destination, Root, Source};
    use std::thread;
    use std::time::Duration;

    /// Bytes of one message: MPI counts them with 31 bits.
    const MESSAGE: usize = 1 << 30;
    /// How often a rank without work looks for some. MPI itself would look all the time, on a core
    /// that rank 0 may need to read photographs.
    const LOOK: Duration = Duration::from_millis(2);

    /// All ranks.
    pub(super) struct World;

    fn world() -> SimpleCommunicator {
        SimpleCommunicator::world()
    }

    impl Group for World {
        fn rank(&self) -> usize {
            world().rank() as usize
        }

        fn size(&self) -> usize {
            world().size() as usize
        }

        fn broadcast(&self, mut bytes: Vec<u8>) -> Vec<u8> {
            let world = world();
            let first = world.process_at_rank(0);
            if world.rank() == 0 {
                for rank in 1..world.size() {
                    world.process_at_rank(rank).send(&(bytes.len() as u64));
                }
            } else {
                while first.immediate_probe().is_none() {
                    thread::sleep(LOOK);
                }
                let (length, _) = first.receive::<u64>();
                bytes = vec![0; length as usize];
            }
            for message in bytes.chunks_mut(MESSAGE) {
                first.broadcast_into(message);
            }
            bytes
        }

        fn gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
            let world = world();
            let mut lengths = vec![0_u64; world.size() as usize];
            world.all_gather_into(&(own.len() as u64), &mut lengths[..]);
            let part = |(rank, length): (i32, u64)| {
                let mut part = if rank == world.rank() {
                    own.to_vec()
                } else {
                    vec![0; length as usize]
                };
                for message in part.chunks_mut(MESSAGE) {
                    world.process_at_rank(rank).broadcast_into(message);
                }
                part
            };
            (0..).zip(lengths).map(part).collect()
        }
    }
}
