// Draft a T-shirt, a shirt and trousers with FreeSewing's public designs for the measurements of the package's own bodies.
//
//     python benchmarks/wardrobe_beside.py --inputs > inputs.json
//     node benchmarks/draft_wardrobe.mjs inputs.json > benchmarks/drafted_wardrobe.json
//
// Needs the packages @freesewing/teagan, simon and charlie (4.10.2, MIT licence), and those that they import (core, brian, titan, library,
// config, snapseries, plugin-flip, plugin-bust, plugin-transform; `npm install --legacy-peer-deps`), where node finds them from the working
// folder. Prints key lengths of each garment and size [mm]; see wardrobe_beside.py.

import { readFileSync } from 'node:fs'
import { createRequire } from 'node:module'
import { pathToFileURL } from 'node:url'

const find = createRequire(`${process.cwd()}/`)
const load = async (name) => (await import(pathToFileURL(find.resolve(`@freesewing/${name}`)).href))[name[0].toUpperCase() + name.slice(1)]
const [Teagan, Simon, Charlie] = await Promise.all(['teagan', 'simon', 'charlie'].map(load))

const draft = (Design, { measurements, options }) => {
  const pattern = new Design({ measurements, options, sa: 0, complete: false, paperless: false })
  pattern.draft()
  const errors = pattern.setStores[0].logs.error
  if (errors.length) console.error(String(errors[0]))
  return pattern
}

/** Return half of what a body block has, of which both tops are made. */
function top(parts, front, back, sleeve) {
  const found = {}
  let armhole = 0
  for (const [face, part] of [['front', front], ['back', back]]) {
    const p = part.points
    const rest = new part.Path().move(p.armhole).curve(p.armholeCp2, p.armholeHollowCp1, p.armholeHollow).curve(p.armholeHollowCp2, p.armholePitchCp1, p.armholePitch)
    armhole += rest.length() + new part.Path().move(p.armholePitch).curve_(p.armholePitchCp2, p.shoulder).length()
  }
  const f = front.points, b = back.points, s = sleeve.points
  found.chest = 2 * (f.armhole.x + b.armhole.x)
  found['armhole, one'] = armhole
  found['sleeve cap'] = sleeve.paths.sleevecap.length()
  found['sleeve at biceps'] = s.bicepsLeft.dist(s.bicepsRight)
  found['shoulder front'] = f.hps.dist(f.shoulder)
  found['nape to waist'] = b.cbNeck.dist(b.cbWaist)
  return found
}

function extent(path) {
  const box = path.bbox ? path.bbox() : null
  const points = path.ops.flatMap((op) => (op.to ? [op.to] : []))
  const xs = points.map((p) => p.x)
  return box ? box.bottomRight.x - box.topLeft.x : Math.max(...xs) - Math.min(...xs)
}

function tshirt(given) {
  const parts = draft(Teagan, given).parts[0]
  return top(parts, parts['teagan.front'], parts['teagan.back'], parts['library.sleeve'])
}

function shirt(given) {
  const parts = draft(Simon, given).parts[0]
  const found = top(parts, parts['brian.front'], parts['brian.back'], parts['library.sleeve'])
  found.neck = 2 * (parts['brian.front'].paths.frontCollar.length() + parts['brian.back'].paths.backCollar.length())
  found.cuff = extent(parts['simon.cuff'].paths.seam)
  return found
}

function trousers(given) {
  const pattern = draft(Charlie, given)
  const parts = pattern.parts[0], { front, back } = { front: parts['titan.front'], back: parts['titan.back'] }
  const f = front.points, b = back.points, path = () => new front.Path()
  // As the design draws it: by the seat where the waist lies outside of that.
  const outseam = path().move(b.floorOut).line(b.kneeOut)
  if (b.waistOut.x > b.seatOut.x) outseam.curve(b.kneeOutCp2, b.seatOut, b.styleWaistOut)
  else outseam.curve(b.kneeOutCp2, b.seatOutCp1, b.seatOut).curve_(b.seatOutCp2, b.styleWaistOut)
  return {
    seat: 2 * (Math.abs(f.cfSeat.x - f.seatOut.x) + Math.abs(b.cbSeat.x - b.seatOut.x)),
    inseam: path().move(b.fork).curve(b.forkCp2, b.kneeInCp1, b.kneeIn).line(b.floorIn).length(),
    outseam: outseam.length(),
    'crotch front': path().move(f.styleWaistIn).line(f.crotchSeamCurveStart).curve(f.crotchSeamCurveCp1, f.crotchSeamCurveCp2, f.fork).length(),
    'crotch back': path().move(b.styleWaistIn).line(b.crossSeamCurveStart).curve(b.crossSeamCurveCp1, b.crossSeamCurveCp2, b.fork).length(),
    hem: f.floorIn.dist(f.floorOut) + b.floorIn.dist(b.floorOut),
    knee: f.kneeIn.dist(f.kneeOut) + b.kneeIn.dist(b.kneeOut),
  }
}

const make = { tshirt, shirt, trousers }
const inputs = JSON.parse(readFileSync(process.argv[2], 'utf-8'))
const found = Object.fromEntries(
  Object.entries(inputs).map(([size, garments]) => [
    size, Object.fromEntries(Object.entries(garments).map(([name, given]) => [name, make[name](given)])),
  ])
)
console.log(JSON.stringify(found, (_, value) => (typeof value === 'number' ? Math.round(value) : value)))
