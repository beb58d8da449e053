// Figures as PNG files, with their titles, on the colour of the page.
import { colour, element } from './dom.js';

function composed(canvas, title) {
  const scale = devicePixelRatio;
  const head = 34 * scale;
  // As large as it is shown: a heat map has one pixel a cell.
  const width = Math.max(canvas.width, Math.round(canvas.clientWidth * scale));
  const height = Math.round((canvas.height * width) / canvas.width);
  const sheet = element('canvas', { width: width + 16 * scale, height: height + head + 8 * scale });
  const ctx = sheet.getContext('2d');
  ctx.fillStyle = colour('card');
  ctx.fillRect(0, 0, sheet.width, sheet.height);
  ctx.fillStyle = colour('text');
  ctx.font = `600 ${16 * scale}px system-ui, sans-serif`;
  ctx.fillText(title, 8 * scale, 22 * scale);
  ctx.imageSmoothingEnabled = false;
  ctx.drawImage(canvas, 8 * scale, head, width, height);
  return sheet;
}

/** A button that saves what the panel's canvas shows; null where it has none. */
export function saveButton(panel, body) {
  const canvas = body.querySelector('canvas');
  if (!canvas) return null;
  const button = element('button', { type: 'button', className: 'save', title: `Save "${panel.title}" as a PNG file` }, 'PNG');
  button.addEventListener('click', () => {
    canvas.dispatchEvent(new Event('beforesave')); // a canvas of WebGL is empty until it is drawn again
    composed(canvas, panel.title).toBlob((png) => {
      const link = element('a', { href: URL.createObjectURL(png), download: `${panel.title.replace(/[^\w.-]+/g, '_')}.png` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  });
  return button;
}
