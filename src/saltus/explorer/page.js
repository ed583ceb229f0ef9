// Keys, buttons in lists and tables, and some others: what they ask for goes to the server as a wish.
{
  const modelOf = name => {
    const owner = Bokeh.documents.find(known => known.get_model_by_name(name) != null)
    return owner?.get_model_by_name(name)
  }
  let said = 0
  const wish = window.wish = asked => {
    const model = modelOf('wishes')
    if (model) model.data = {wish: [JSON.stringify(asked)], at: [++said]}
  }

  // what was said before this has reached the server when it answers; it may be gone, and then the page says so
  const PATIENCE = 5000 // milliseconds
  window.heard = () => new Promise(done => {
    const model = modelOf('wishes'), mark = `leave ${++said}`
    if (!model) return done(false)
    model.properties.tags.change.connect(() => model.tags.includes(mark) && done(true))
    setTimeout(() => done(false), PATIENCE)
    wish(['leave', mark])
  })

  document.addEventListener('click', event => {
    for (const node of event.composedPath()) {
      if (node.dataset?.copy) return navigator.clipboard.writeText(node.dataset.copy)
      if (node.dataset?.wish) return wish(JSON.parse(node.dataset.wish))
    }
  })

  // a field for a number passes over a text that is none, or lies beyond its ends, without a word: the page says it
  const modelOfField = input => {
    const host = input.closest?.('.bk-spin-wrapper') && input.getRootNode().host
    return host && Bokeh.index.query_one(view => view.el === host)?.model
  }
  const refuse = (model, text) => {
    const name = model.css_classes[0]?.replace('-', ' ') || model.title
    const ends = model.high == null ? '' : ` from ${model.low} to ${model.high}`
    wish(['refused', name, text, (model.mode == 'int' ? 'a whole number' : 'a number') + ends])
  }
  // an emptied field has no value, or NaN, and may write so itself
  const holds = (model, number) => number === model.value || Number.isNaN(number) && Number.isNaN(model.value ?? NaN)
  const look = (model, text) => text.trim() && !holds(model, Number(text)) && refuse(model, text)
  document.addEventListener('input', event => { // before the field has taken characters away that it does not know
    const input = event.composedPath()[0], text = input.value, model = modelOfField(input)
    if (model) setTimeout(() => input.value != text && refuse(model, text))
  }, true)
  document.addEventListener('focusout', event => { // before the field shows its number again
    const input = event.composedPath()[0], model = modelOfField(input)
    if (model) look(model, input.value)
  }, true)
  document.addEventListener('keydown', event => {
    const input = event.composedPath()[0], model = event.key == 'Enter' && modelOfField(input)
    if (model) setTimeout(() => look(model, input.value)) // when the field has taken it
  }, true)

  // steps of a key that is held come together, so that the server keeps up
  let ahead = 0, waiting = null
  const step = count => {
    ahead += count
    waiting ??= setTimeout(() => {
      const whole = ahead
      ahead = 0
      waiting = null
      if (whole) wish(['step', whole, false])
    }, 60)
  }

  const zoom = share => {
    const figure = modelOf('diagram-figure')
    for (const range of [figure.x_range, figure.y_range]) {
      const middle = 0.5 * (range.start + range.end), half = 0.5 * share * (range.end - range.start)
      range.setv({start: middle - half, end: middle + half})
    }
    wish(['name'])
  }
  const whole = () => {
    const figure = modelOf('diagram-figure')
    for (const range of [figure.x_range, figure.y_range]) range.setv({start: range.reset_start, end: range.reset_end})
    wish(['name'])
  }

  const keys = {
    ArrowRight: event => step(event.shiftKey ? 10 : 1),
    ArrowLeft: event => step(event.shiftKey ? -10 : -1),
    ArrowUp: () => wish(['step', 1, true]),
    ArrowDown: () => wish(['step', -1, true]),
    Home: () => wish(['step', -1e9, false]),
    End: () => wish(['step', 1e9, false]),
    '+': () => zoom(0.8),
    '-': () => zoom(1.25),
    0: whole,
  }

  // what takes no part in the order of the tabulator by itself
  const reach = root => {
    for (const node of root.querySelectorAll('*')) {
      if (node.classList.contains('bk-tab')) {
        node.tabIndex = 0
        node.setAttribute('role', 'tab')
      }
      if (node.shadowRoot) reach(node.shadowRoot)
    }
  }

  const beside = (button, way) => { // the button of the row above or below
    const rows = [...button.closest('table').querySelectorAll('button.point')]
    rows[rows.indexOf(button) + way]?.focus()
  }

  document.addEventListener('keydown', event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return
    const path = event.composedPath(), at = path[0]
    if (event.key == 'Tab') return reach(document)
    if (event.key == 'Escape') return wish(['close'])
    if (at.classList?.contains('bk-tab') && ['Enter', ' '].includes(event.key)) {
      event.preventDefault()
      return at.click()
    }
    if (at.classList?.contains('point') && ['ArrowUp', 'ArrowDown'].includes(event.key)) {
      event.preventDefault()
      return beside(at, event.key == 'ArrowUp' ? -1 : 1)
    }
    const free = at === document.body || path.some(node => node.classList?.contains('diagram'))
      && !['INPUT', 'SELECT', 'BUTTON', 'A'].includes(at.tagName)
    if (free && keys[event.key]) {
      event.preventDefault()
      keys[event.key](event)
    }
  })
}

// Figures ask the browser for styles at each painting, which makes it work out those of the whole page: a fifth of a picture's
// time. Here style sheets say nothing of a figure's colours, and its font keeps its size.
try {
  const {VisualProperties} = Bokeh.require('core/visuals/visual'), {PlotView} = Bokeh.require('models/plots/plot_canvas')
  const {get} = Object.getOwnPropertyDescriptor(PlotView.prototype, 'base_font_size'), sizes = new WeakMap()
  VisualProperties.prototype._get_css_value = () => ''
  Object.defineProperty(PlotView.prototype, 'base_font_size', {get() {
    if (!sizes.has(this)) sizes.set(this, get.call(this))
    return sizes.get(this)
  }})
} catch (error) {
  console.warn('saltus: figures are drawn slowly by this version of Bokeh', error)
}
