//! What particles there are under a point, in a box, and of which values.

use std::collections::BTreeMap;

use fearless_simd::{Level, dispatch};
use glam::{DVec2, DVec3, Vec3};
use motes_grid::{Grid, Visibility};
use motes_particles::read::names;
use motes_particles::{Particles, Values, select};
use motes_scene::{CameraView, Component, Element, Light, Renderer, Scene};
use motes_spheres::{Counts, Packet};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use crate::entries::Entries;
use crate::paint::{Paint, find_property};
use crate::session::Seen;
use crate::system::Loaded;
use crate::{Error, Result};

/// Indices that are told of what was selected.
const INDICES: usize = 1000;
/// Bins of a histogram, at most.
const BINS: u64 = 4096;

/// A particle that was found.
struct Found<'a> {
    loaded: &'a Loaded,
    index: u32,
    /// In world coordinates.
    center: DVec3,
    radius: f32,
    depth: f32,
}

/// The particle at a place of the picture, 0 to 1 from the left and from the top: what a sphere's pixel
/// shows; of a liquid what stands in it, else the ball that the eye meets first.
pub(super) fn pick(scene: &Scene, seen: &Seen, at: [f64; 2]) -> Result<Value> {
    let view = view_of(scene, seen)?;
    let place = [(at[0], view.width), (at[1], view.height)].map(|(part, pixels)| {
        let last = f64::from(pixels) - 1.0;
        (part * f64::from(pixels)).floor().clamp(0.0, last) + 0.5
    });
    let found = met(scene, seen, (&view, place));
    Ok(json!({"picked": found.map(|found| describe(scene, &found))}))
}

/// What the ray through a place of the picture (pixels) meets.
fn met<'a>(
    scene: &Scene,
    seen: &'a Seen,
    (view, place): (&CameraView, [f64; 2]),
) -> Option<Found<'a>> {
    let ray = view.rays(seen.origin).ray(place[0] as f32, place[1] as f32);
    let about = (&scene.light, seen.origin);
    match (&seen.loaded[..], scene.renderer) {
        (all, Renderer::Spheres) => sphere_at(all, ray, about),
        ([], _) => None,
        ([liquid, others @ ..], _) => sphere_at(others, ray, about)
            .or_else(|| ball_at(liquid, ray, (scene.surface.ball as f32, seen.origin))),
    }
}

/// The cutting plane of a line that is drawn on the picture, 0 to 1 from the left and from the top.
///
/// # Errors
/// The line has no length, or leads over nothing that is seen.
pub(super) fn drag(scene: &Scene, seen: &Seen, ends: [[f64; 2]; 2]) -> Result<Value> {
    let view = view_of(scene, seen)?;
    let size = DVec2::new(f64::from(view.width), f64::from(view.height));
    let [from, to] = ends.map(|at| DVec2::from_array(at) * size);
    let depth = |x: u32, y: u32| {
        let place = [f64::from(x) + 0.5, f64::from(y) + 0.5];
        Some(f64::from(met(scene, seen, (&view, place))?.depth))
    };
    let section = view.section_of_drag((from, to), &depth)?;
    Ok(json!({"point": section.point, "normal": section.normal}))
}

/// The camera of the whole canvas, before what was seen.
fn view_of(scene: &Scene, seen: &Seen) -> Result<CameraView> {
    Ok(scene.resolve_framing(seen.framing(scene))?.view)
}

/// The sphere that a ray meets first.
fn sphere_at<'a>(
    loaded: &'a [Loaded],
    (origin, direction): (Vec3, Vec3),
    (light, about): (&Light, DVec3),
) -> Option<Found<'a>> {
    let entries = Entries::new(loaded, light);
    let mut packet = Packet::new();
    packet.push(origin, direction);
    dispatch!(Level::new(), simd =>
        motes_spheres::trace(simd, &mut packet, &entries.spheres, &mut Counts::default()));
    let (depth, entry, slot) = packet.hit(0)?;
    let (grid, place) = entries.spheres.get(usize::from(entry))?.locate(slot);
    Some(found(entries.system(entry), (grid, place), (depth, about)))
}

fn found<'a>(
    loaded: &'a Loaded,
    (grid, place): (&Grid, usize),
    (depth, about): (f32, DVec3),
) -> Found<'a> {
    let center = grid.center(place).as_dvec3() + about;
    Found { loaded, index: grid.index(place), center, radius: grid.radius_at(place), depth }
}

/// The ball, so many radii large, that a ray meets first; of two as near the lower index.
fn ball_at<'a>(
    loaded: &'a Loaded,
    (origin, direction): (Vec3, Vec3),
    (scale, about): (f32, DVec3),
) -> Option<Found<'a>> {
    let nearest = |grid: &'a Grid, visible: &'a Visibility| {
        let of_block = move |block: usize| {
            let shown = visible.block(grid, block);
            let slots = grid.particles_of(block).enumerate();
            let met = slots.filter(|(i, _)| shown.shows(*i)).filter_map(|(_, slot)| {
                let radius = grid.radius_at(slot) * scale;
                let depth = meets(grid.center(slot) - origin, radius, direction)?;
                Some((depth, grid.index(slot), slot))
            });
            met.min_by(|a, b| {
                (a.0, a.1).partial_cmp(&(b.0, b.1)).unwrap_or(std::cmp::Ordering::Equal)
            })
        };
        let all = (0..grid.blocks.len() - 1).into_par_iter().filter_map(of_block);
        all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    };
    let grids = loaded.classes.grids.iter().zip(loaded.visible());
    let met = grids.filter_map(|(grid, visible)| Some((nearest(grid, visible)?, grid)));
    let ((depth, _, slot), grid) = met.min_by(|(a, _), (b, _)| a.0.total_cmp(&b.0))?;
    Some(found(loaded, (grid, slot), (depth, about)))
}

/// Where a ray enters a ball, or leaves it if it begins inside.
fn meets(to_center: Vec3, radius: f32, direction: Vec3) -> Option<f32> {
    let along = to_center.dot(direction);
    let aside = (to_center - direction * along).length_squared();
    let half = radius * radius - aside;
    let half = if half >= 0.0 { half.sqrt() } else { return None };
    [along - half, along + half].into_iter().find(|depth| *depth > 0.0)
}

/// All that is known of a particle.
fn describe(scene: &Scene, found: &Found<'_>) -> Value {
    let Found { loaded, index, center, radius, depth } = *found;
    let particles = &loaded.particles;
    let row = index as usize;
    let number = usize::from(loaded.number);
    let system = scene.system.get(number);
    let name = system.map_or("", |s| if s.name.is_empty() { &s.source } else { &s.name });
    let properties: Map<String, Value> = particles
        .columns
        .iter()
        .map(|column| {
            let all =
                (0..column.components).map(|c| value(&column.values, row * column.components + c));
            let mut all: Vec<Value> = all.collect();
            let value = if all.len() == 1 { all.remove(0) } else { all.into() };
            (column.name.clone(), value)
        })
        .collect();
    let kind = properties.get(names::PARTICLE_TYPE).cloned();
    let element = kind.as_ref().and_then(Value::as_str).and_then(Element::by_symbol);
    json!({
        "system": number,
        "name": name,
        "index": index,
        "id": properties.get(names::PARTICLE_IDENTIFIER),
        "type": kind,
        "element": element.map(|e| e.symbol),
        "position": center,
        "radius": radius,
        "depth": depth,
        "properties": properties,
    })
}

fn value(values: &Values, i: usize) -> Value {
    match values {
        Values::F32(v) => json!(v.get(i)),
        Values::F64(v) => json!(v.get(i)),
        Values::I32(v) => json!(v.get(i)),
        Values::I64(v) => json!(v.get(i)),
        Values::U8(v) => json!(v.get(i)),
        Values::Names { codes, names } => {
            json!(codes.get(i).and_then(|code| names.get(*code as usize)))
        }
    }
}

/// The visible particles whose centre lies in a box of the picture: how many there are, which, and the
/// values of the first system's.
pub(super) fn choose(scene: &Scene, seen: &Seen, corners: [f64; 4]) -> Result<Value> {
    let view = view_of(scene, seen)?;
    let [x0, y0, x1, y1] = corners;
    let size = [view.width, view.height].map(f64::from);
    let ends = |a: f64, b: f64, pixels: f64| (a.min(b) * pixels, a.max(b) * pixels);
    let (xs, ys) = (ends(x0, x1, size[0]), ends(y0, y1, size[1]));
    let inside = |center: Vec3| {
        let at = view.project(center.as_dvec3() + seen.origin);
        at.is_some_and(|at| xs.0 <= at.x && at.x <= xs.1 && ys.0 <= at.y && at.y <= ys.1)
    };
    let all: Vec<Vec<u32>> = seen.loaded.iter().map(|l| visible_where(l, &inside)).collect();
    let count: usize = all.iter().map(Vec::len).sum();
    let (first, loaded) = match (all.first(), seen.loaded.first()) {
        (Some(first), Some(loaded)) => (&first[..], loaded),
        _ => return Ok(json!({"count": 0, "indices": [], "properties": {}})),
    };
    Ok(json!({
        "count": count,
        "indices": &first[..first.len().min(INDICES)],
        "properties": summary(&loaded.particles, first),
    }))
}

/// The indices of visible particles for whose centre something holds, in order.
fn visible_where(loaded: &Loaded, holds: &(dyn Fn(Vec3) -> bool + Sync)) -> Vec<u32> {
    let mut all = Vec::new();
    for (grid, visible) in loaded.classes.grids.iter().zip(loaded.visible()) {
        let of_block = |block: usize| {
            let shown = visible.block(grid, block);
            let slots = grid.particles_of(block).enumerate();
            let slots = slots.filter(move |(i, _)| shown.shows(*i)).map(|(_, slot)| slot);
            slots.filter(|slot| holds(grid.center(*slot))).map(|slot| grid.index(slot))
        };
        all.par_extend((0..grid.blocks.len() - 1).into_par_iter().flat_map_iter(of_block));
    }
    all.par_sort_unstable();
    all
}

/// Least, greatest and mean value of each property of some particles; of vectors the length.
fn summary(particles: &Particles, rows: &[u32]) -> BTreeMap<String, Value> {
    let named = |column: &&motes_particles::Column| !matches!(column.values, Values::Names { .. });
    let of = |column: &motes_particles::Column| {
        let numbers = rows.iter().map(|row| column.magnitude(*row as usize));
        let finite = numbers.filter(|v| v.is_finite());
        let none = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
        let (min, max, sum, count) = finite.fold(none, |(low, high, sum, count), v| {
            (v.min(low), v.max(high), sum + v, count + 1.0)
        });
        (column.name.clone(), json!({"min": min, "max": max, "mean": sum / count}))
    };
    particles.columns.iter().filter(named).map(of).collect()
}

/// How many particles have which values of a property.
pub(super) fn histogram(seen: &Seen, fields: &Map<String, Value>) -> Result<Value> {
    let particles = &system(seen, fields)?.particles;
    let wrong = |what: &str| Error::Usage(format!("expected {what}"));
    let name = fields.get("property").and_then(Value::as_str);
    let name = name.ok_or_else(|| wrong("`property`, the name of one"))?;
    let bins = fields.get("bins").map_or(Some(256), Value::as_u64);
    let bins = bins.filter(|n| (1..=BINS).contains(n));
    let bins = bins.ok_or_else(|| wrong(&format!("`bins`, 1 to {BINS}")))? as usize;
    let property = find_property(particles, name, component(fields)?)?;
    let number = |row: usize| property.value(particles, row);
    let (none, rows) = ((f64::INFINITY, f64::NEG_INFINITY), 0..particles.len());
    let (min, max) = rows
        .clone()
        .into_par_iter()
        .map(number)
        .filter(|v| v.is_finite())
        .fold(|| none, |(low, high), v| (v.min(low), v.max(high)))
        .reduce(|| none, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let scale = if max > min { bins as f64 / (max - min) } else { 0.0 };
    let empty = || (vec![0_u64; bins], 0_u64);
    let (counts, missing) = rows
        .into_par_iter()
        .with_min_len(1 << 14)
        .map(number)
        .fold(empty, |(mut counts, missing), v| {
            if !v.is_finite() {
                return (counts, missing + 1);
            }
            counts[(((v - min) * scale) as usize).min(bins - 1)] += 1;
            (counts, missing)
        })
        .reduce(empty, |(mut a, missing), (b, more)| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            (a, missing + more)
        });
    Ok(json!({"min": min, "max": max, "counts": counts, "missing": missing}))
}

/// How many particles an expression is true of.
pub(super) fn check(seen: &Seen, fields: &Map<String, Value>) -> Result<Value> {
    let particles = &system(seen, fields)?.particles;
    let text = fields.get("where").and_then(Value::as_str).unwrap_or_default();
    if text.trim().is_empty() {
        return Ok(json!({"count": particles.len()}));
    }
    let selected = select(text, particles).map_err(|e| Error::Usage(e.to_string()))?;
    Ok(json!({"count": selected.count()}))
}

/// Refuses a scene that asks for what the particles seen last do not have, where it differs from another.
///
/// # Errors
/// As drawing it would.
pub(super) fn check_changes((scene, before): (&Scene, &Scene), seen: &Seen) -> Result<()> {
    for loaded in &seen.loaded {
        let number = usize::from(loaded.number);
        let (Some(system), Some(had)) = (scene.system.get(number), before.system.get(number))
        else {
            continue;
        };
        let particles = &loaded.particles;
        if system.r#where != had.r#where && !system.r#where.trim().is_empty() {
            select(&system.r#where, particles).map_err(|e| Error::Usage(e.to_string()))?;
        }
        if system.filter != had.filter {
            for filter in &system.filter {
                find_property(particles, &filter.property, filter.component)?;
            }
        }
        if (&system.color.by, &system.color.map) != (&had.color.by, &had.color.map) {
            Paint::new(particles, system, None)?;
        }
    }
    Ok(())
}

/// The system that a request names.
fn system<'a>(seen: &'a Seen, fields: &Map<String, Value>) -> Result<&'a Loaded> {
    let number = fields.get("system").map_or(Some(0), Value::as_u64);
    let loaded = number.and_then(|n| seen.loaded.iter().find(|l| u64::from(l.number) == n));
    loaded.ok_or_else(|| Error::Usage("expected `system`, the number of one that is shown".into()))
}

/// The component that a request names, by its letter or its number.
fn component(fields: &Map<String, Value>) -> Result<Component> {
    Ok(match fields.get("component") {
        None | Some(Value::Null) => Component::Magnitude,
        Some(Value::String(word)) if word == "magnitude" => Component::Magnitude,
        Some(Value::String(word)) if word == "x" => Component::X,
        Some(Value::String(word)) if word == "y" => Component::Y,
        Some(Value::String(word)) if word == "z" => Component::Z,
        Some(Value::Number(n)) if n.as_u64() == Some(0) => Component::X,
        Some(Value::Number(n)) if n.as_u64() == Some(1) => Component::Y,
        Some(Value::Number(n)) if n.as_u64() == Some(2) => Component::Z,
        _ => return Err(Error::Usage("expected `component`: x, y, z or magnitude".into())),
    })
}
