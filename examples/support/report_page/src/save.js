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

/** The photograph with the marks that are shown over it, at its own size. */
async function photograph(picture) {
  const image = picture.querySelector('img');
  const marks = picture.querySelector('svg').cloneNode(true);
  // Away from the page the marks have neither its colours nor the rule by which their width is that of the screen.
  const shown = picture.querySelectorAll('g');
  marks.querySelectorAll('g').forEach((group, i) => {
    group.setAttribute('stroke', getComputedStyle(shown[i].firstChild).stroke);
    group.setAttribute('fill', 'none');
    group.setAttribute('stroke-linecap', 'round');
  });
  marks.setAttribute('width', image.naturalWidth);
  marks.setAttribute('height', image.naturalHeight);
  const drawn = new Image();
  drawn.src = `data:image/svg+xml,${encodeURIComponent(new XMLSerializer().serializeToString(marks))}`;
  await drawn.decode();
  const canvas = element('canvas', { width: image.naturalWidth, height: image.naturalHeight });
  const ctx = canvas.getContext('2d');
  ctx.drawImage(image, 0, 0);
  ctx.drawImage(drawn, 0, 0);
  return canvas;
}

/** A button that saves what the panel's canvas or picture shows; null where it has none. */
export function saveButton(panel, body) {
  const canvas = body.querySelector('canvas');
  const picture = body.querySelector('.picture');
  if (!canvas && !picture) return null;
  const button = element('button', { type: 'button', className: 'save', title: `Save "${panel.title}" as a PNG file` }, 'PNG');
  button.addEventListener('click', async () => {
    canvas?.dispatchEvent(new Event('beforesave')); // a canvas of WebGL is empty until it is drawn again
    composed(canvas ?? (await photograph(picture)), panel.title).toBlob((png) => {
      const link = element('a', { href: URL.createObjectURL(png), download: `${panel.title.replace(/[^\w.-]+/g, '_')}.png` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  });
  return button;
}
