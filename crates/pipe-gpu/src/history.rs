//! Values kept between frames: rings of copies, by name.
//!
//! Rejected: handing the memory itself over instead of copying it, which would make bind groups anew in every frame;
//! a copy runs at the device's full bandwidth, and the slots of a plan stay what they are.

use std::collections::{HashMap, VecDeque};

use pipe_plan::plan::{Plan, Storage};

use crate::device::Device;
use crate::error::GpuError;
use crate::storage::{Memory, allocate};

/// Earlier values, the newest last, with the storage that they have.
#[derive(Default)]
pub(crate) struct Histories(HashMap<String, (Storage, VecDeque<Memory>)>);

impl Histories {
    /// Fills the slots of histories with the values of `delay` frames ago, with zeros where there are none yet.
    pub(crate) fn recall(&self, device: &Device, plan: &Plan, memory: &[Memory]) {
        if plan.histories.iter().all(|h| h.recall.is_none()) {
            return;
        }
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for history in &plan.histories {
            let Some(slot) = history.recall.and_then(|slot| memory.get(slot.0 as usize)) else { continue };
            let storage = history.recall.map(|slot| plan.slots[slot.0 as usize].storage);
            let ring = self.0.get(&history.name).filter(|(of, _)| Some(*of) == storage).map(|(_, ring)| ring);
            let old = ring.and_then(|ring| ring.get(ring.len().checked_sub(history.delay as usize)?));
            match old {
                Some(old) => old.copy_to(slot, &mut encoder),
                None if matches!(slot, Memory::Buffer(_)) || device.has(wgpu::Features::CLEAR_TEXTURE) => slot.zero(&mut encoder),
                // The plan does not read it in the first frames.
                None => {}
            }
        }
        device.queue.submit([encoder.finish()]);
    }

    /// Keeps the new values.
    pub(crate) fn keep(&mut self, device: &Device, plan: &Plan, memory: &[Memory]) -> Result<(), GpuError> {
        if plan.histories.is_empty() {
            return Ok(());
        }
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for history in &plan.histories {
            let at = history.keep.0 as usize;
            let storage = plan.slots[at].storage;
            let (of, ring) = self.0.entry(history.name.clone()).or_insert_with(|| (storage, VecDeque::new()));
            if *of != storage {
                // Frames of another size: what was kept says nothing about them.
                ring.clear();
                *of = storage;
            }
            let oldest = if ring.len() >= history.delay.max(1) as usize { ring.pop_front() } else { None };
            let kept = match oldest {
                Some(memory) => memory,
                None => allocate(device, &plan.slots[at], false, &history.name)?,
            };
            memory[at].copy_to(&kept, &mut encoder);
            ring.push_back(kept);
        }
        device.queue.submit([encoder.finish()]);
        device.check(&plan.name)
    }

    /// Forgets everything: the next frame is a first one.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }
}
