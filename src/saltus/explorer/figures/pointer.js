// What the pointer is at: the nearest place of the sources, told beside it. `reach` is in pixels; sources given first
// are nearer by `bonus`.
const hide = () => {
  tip.visible = false
  ring.data = {x: [], y: []}
}
if (cb_obj.event_name != 'mousemove') {
  hide()
  return
}
const x_range = figure.x_range, y_range = figure.y_range
const wide = figure.inner_width / Math.abs(x_range.end - x_range.start)
const high = figure.inner_height / Math.abs(y_range.end - y_range.start)
let best = reach, found = null
sources.forEach((source, rank) => {
  const {x, y, tip} = source.data, nearer = rank + 1 < sources.length ? bonus : 0
  for (let i = 0; i < x.length; i++) {
    const away = Math.hypot((x[i] - cb_obj.x) * wide, (y[i] - cb_obj.y) * high) - nearer
    if (away < best) {
      best = away
      found = {x: x[i], y: y[i], told: tip[i], source}
    }
  }
})
if (found == null) {
  hide()
  return
}
const names = [figure.below[0].axis_label, figure.left[0].axis_label]
const places = [found.x, found.y].map((value, i) => `${names[i]} = ${String(+value.toPrecision(9)).replace('-', '−')}`)
const there = ({x, y}, i) => Math.hypot((x[i] - found.x) * wide, (y[i] - found.y) * high) < together
const {data} = found.source
const told = sources.length > 1 && found.source === sources[0]
  ? Array.from(data.tip).filter((_, i) => there(data, i)) : [found.told]
const lines = told.length > 4 ? [...told.slice(0, 3), `and ${told.length - 3} more: click for a list`] : told
const right = found.x > 0.5 * (x_range.start + x_range.end), up = found.y > 0.5 * (y_range.start + y_range.end)
tip.setv({
  x: found.x, y: found.y, text: [...lines, ...places].join('\n'), visible: true,
  x_offset: right ? -12 : 12, y_offset: up ? -12 : 12,
  text_align: right ? 'right' : 'left', text_baseline: up ? 'top' : 'bottom',
})
ring.data = {x: [found.x], y: [found.y]}
