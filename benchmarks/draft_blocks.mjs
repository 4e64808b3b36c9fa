// Draft blocks with FreeSewing's public designs for the lengths and girths of the package's own forms, size by size.
//
//     python benchmarks/blocks.py --inputs > inputs.json
//     node benchmarks/draft_blocks.mjs inputs.json > benchmarks/drafted_blocks.json
//
// Needs the packages @freesewing/core, bella, penelope and brian (4.10.2, MIT licence) where node finds them from the working folder.
// Prints two drafts of each size [mm; areas in cm2], of half a piece; see blocks.py. Ease and depths are those of the form, options that
// add to them are off. What cannot be given, as how front and back share the shoulder's slope, is the design's.

import { readFileSync } from 'node:fs'
import { createRequire } from 'node:module'
import { pathToFileURL } from 'node:url'

const find = createRequire(`${process.cwd()}/`)
const load = (name) => import(pathToFileURL(find.resolve(`@freesewing/${name}`)).href)
const [{ Bella }, { Penelope }, { Brian }] = await Promise.all(['bella', 'penelope', 'brian'].map(load))

/** Return points along a path, and where its subpaths start. */
function outline(path) {
  const points = []
  let from
  for (const op of path.ops) {
    if (op.type === 'move' || op.type === 'line') points.push(op.to)
    else if (op.type === 'curve')
      for (let i = 1; i <= 60; i++) {
        const t = i / 60, s = 1 - t
        const at = (key) => s ** 3 * from[key] + 3 * s * s * t * op.cp1[key] + 3 * s * t * t * op.cp2[key] + t ** 3 * op.to[key]
        points.push({ x: at('x'), y: at('y') })
      }
    from = op.to ?? from
  }
  return points
}

/** Return the area within a closed path [cm2]. */
function area(path) {
  const points = outline(path)
  const twice = points.reduce((sum, p, i) => {
    const q = points[(i + 1) % points.length]
    return sum + p.x * q.y - q.x * p.y
  }, 0)
  return Math.abs(twice) / 200
}

const draft = (Design, measurements, options, only) => {
  const pattern = new Design({ measurements, options, only, sa: 0, complete: false, paperless: false })
  pattern.draft()
  const errors = pattern.setStores?.[0]?.logs?.error ?? []
  if (errors.length) console.error(String(errors[0]))
  return Object.fromEntries(only.map((name) => [name, pattern.parts[0][name]]))
}

/** Return the length of an edge of a skirt between two darts or ends, and the widths of its darts. */
function skirtValues(face, parts) {
  const part = parts[`penelope.${face}`], p = part.points
  const darts = ['dart1', 'dart2'].filter((name) => p[`${name}Start`]).map((name) => p[`${name}Start`].dist(p[`${name}End`]))
  return {
    [`hip ${face}`]: p.lSeat.dist(p.rSeat),
    [`skirt darts ${face}`]: darts.reduce((sum, width) => sum + width, 0),
    [`area ${face} skirt`]: area(part.paths.seam),
  }
}

function women(given, underbust) {
  const measurements = { ...given.measurements, underbust }
  const options = { ...given.bella, fullChestEaseReduction: 0, bustSpanEase: 0, shoulderToShoulderEase: 0, armholeDepth: 0.44 }
  let parts
  // Lengths and the depth of the armhole are given from other points: they are adjusted until they are those of the form.
  for (let i = 0; i < 12; i++) {
    parts = draft(Bella, measurements, options, ['bella.back', 'bella.frontSideDart'])
    const back = parts['bella.back'], p = back.points, f = parts['bella.frontSideDart'].points
    const centre = new back.Path().move(p.cbNeck).curve_(p.cbNeckCp2, p.waistCenter).length()
    const side = new back.Path().move(p.waistSide).curve_(p.waistSideCp2, p.armhole).length()
    const missing = given.lengths['side seam'] - side
    options.armholeDepth = Math.min(0.46, Math.max(0.38, options.armholeDepth - missing / measurements.hpsToWaistBack))
    measurements.hpsToWaistBack += given.lengths['centre back'] - centre
    measurements.hpsToWaistFront += given.lengths['centre front'] - f.cfNeck.dist(f.cfHem)
    measurements.shoulderToShoulder += 1.9 * (given.lengths['shoulder back'] - p.hps.dist(p.shoulder))
  }
  const { 'bella.back': back, 'bella.frontSideDart': front } = parts
  const b = back.points, f = front.points, path = () => new back.Path()
  const off = { lengthBonus: 0, hemBonus: 0, hem: 0, backVent: false, curvedDarts: false }
  const skirt = draft(Penelope, measurements, { ...given.penelope, ...off }, ['penelope.front', 'penelope.back'])
  return {
    'centre front': f.cfNeck.dist(f.cfHem),
    'centre back': path().move(b.cbNeck).curve_(b.cbNeckCp2, b.waistCenter).length(),
    'shoulder front': f.hps.dist(f.shoulder),
    'shoulder back': b.hps.dist(b.shoulder),
    'armhole front': front.paths.armhole.length(),
    'armhole back': back.paths.armhole.length(),
    'side seam': path().move(b.waistSide).curve_(b.waistSideCp2, b.armhole).length(),
    'waist front': f.cfHem.dist(f.waistDartLeft) + f.waistDartRight.dist(f.sideHem),
    'waist back': b.waistCenter.dist(b.dartBottomLeft) + b.dartBottomRight.dist(b.waistSide),
    'bust dart': f.bustDartTop.dist(f.bustDartBottom),
    'waist dart front': f.waistDartLeft.dist(f.waistDartRight),
    'waist dart back': b.dartBottomLeft.dist(b.dartBottomRight),
    ...skirtValues('front', skirt),
    ...skirtValues('back', skirt),
    'area front': area(front.paths.seam),
    'area back': area(back.paths.seam),
  }
}

function men(given, deeper) {
  const deep = deeper ? {} : { bicepsEase: 0, armholeDepth: 0 }
  const measurements = { ...given.measurements }
  let parts
  for (let i = 0; i < 12; i++) {
    parts = draft(Brian, measurements, { ...given.brian, ...deep, collarEase: 0, shoulderEase: 0, lengthBonus: 0 }, ['brian.back', 'brian.front'])
    const p = parts['brian.back'].points
    measurements.hpsToWaistBack += given.lengths.back.centre - p.cbNeck.dist(p.cbWaist)
    measurements.shoulderToShoulder += 1.9 * (given.lengths.back.shoulder - p.hps.dist(p.shoulder))
  }
  const found = {}
  for (const [face, c] of [['back', 'cb'], ['front', 'cf']]) {
    const { points: p, paths } = parts[`brian.${face}`]
    const neck = paths[`${face}Collar`], armhole = paths[`${face}Armhole`]
    const rest = new parts['brian.back'].Path().move(p.armhole).curve(p.armholeCp2, p.armholeHollowCp1, p.armholeHollow).curve(p.armholeHollowCp2, p.armholePitchCp1, p[`${face}ArmholePitch`])
    // The block runs on to the hips, straight down.
    const below = (p.waist.x * (p.hips.y - p.waist.y)) / 100
    found[face] = {
      centre: p[`${c}Neck`].dist(p[`${c}Waist`]), shoulder: p.hps.dist(p.shoulder), side: p.armhole.dist(p.waist), width: p.armhole.x,
      neck: neck.length(), armhole: rest.length() + armhole.length(), area: area(paths.seam) - below,
    }
  }
  return found
}

const inputs = JSON.parse(readFileSync(process.argv[2], 'utf-8'))
const both = (size, given) =>
  size.startsWith('men') ? [men(given, false), men(given, true)] : given.underbusts.map((girth) => women(given, girth))
console.log(JSON.stringify(Object.fromEntries(Object.entries(inputs).map(([size, given]) => [size, both(size, given)])), rounded))

function rounded(key, value) {
  return typeof value === 'number' ? Math.round(value) : value
}
