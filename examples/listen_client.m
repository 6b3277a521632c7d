% Sends a live loop's messages to `seamlog record --listen tcp://127.0.0.1:5577 -o weld.mcap`.
% Octave: pkg install -forge zeromq.  MATLAB has no ZeroMQ of its own: javaaddpath jeromq.jar.
% Wire format: docs/howto/record-from-another-language.md (numbers are little endian).
function listen_client(address)
  if nargin < 1, address = 'tcp://127.0.0.1:5577'; end
  send = connect(address);
  for k = 0:999                                  % the control loop
    t = k * 0.001;
    send('/table/encoder', [0.1 * sin(t), 0.1 * cos(t)]);   % position_m, velocity_m_s
    send('/table/command', [2.0, 0]);                       % command, saturated
    pause(0.001);
  end
  send('end', []);
end

function send = connect(address)
  if exist('OCTAVE_VERSION', 'builtin')
    pkg load zeromq
    socket = zmq_socket(ZMQ_PUSH);
    zmq_connect(socket, address);
    put = @(bytes, more) zmq_send(socket, bytes, more * ZMQ_SNDMORE);
  else
    socket = org.zeromq.ZContext().createSocket(org.zeromq.SocketType.PUSH);
    socket.connect(address);
    put = @(bytes, more) socket.send(typecast(bytes, 'int8'), 2 * more);
  end
  send = @(topic, values) send_message(put, topic, values);
end

function send_message(put, topic, values)
  put(uint8(topic), ~isempty(values));
  if ~isempty(values)
    stamp = int64(0);                            % 0: the recorder stamps at arrival
    put([typecast(stamp, 'uint8'), typecast(double(values), 'uint8')], false);
  end
end
