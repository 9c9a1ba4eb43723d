// Browsers start no workers for pages from the disk. The search runs in a hidden frame instead, which is a worker enough for it.
if (location.protocol === "file:") {
  // By the second name the search knows that its files lie beside its script, not beside the page.
  window.Worker = window.IFrameWorker = class extends EventTarget {
    constructor(url) {
      super()
      const own = new URL(url, location.href)
      const frame = document.createElement("iframe")
      frame.hidden = true
      const loaded = new Promise(resolve => {
        document.body.append(frame)
        const inside = frame.contentWindow
        inside.postMessage = data => this.dispatchEvent(new MessageEvent("message", { data }))
        inside.importScripts = (...scripts) => scripts.reduce((before, each) => before.then(() => load(each)), Promise.resolve())
        const load = source => new Promise((done, failed) => {
          const script = inside.document.createElement("script")
          script.src = new URL(source, own)
          script.onload = done
          script.onerror = failed
          inside.document.head.append(script)
        })
        load(own).then(() => resolve(inside))
      })
      this.postMessage = data => loaded.then(inside => inside.dispatchEvent(new MessageEvent("message", { data })))
    }
  }
}
