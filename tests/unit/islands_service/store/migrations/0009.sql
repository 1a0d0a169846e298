BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0009');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('08d82dc45ba14474bdea73933302fbb0','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('6f8bbf9d840a4f33975f4c5537738131','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE audit (
	number INTEGER NOT NULL, 
	at FLOAT NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	address VARCHAR(64) NOT NULL, details TEXT, 
	CONSTRAINT pk_audit PRIMARY KEY (number)
);
INSERT INTO "audit" VALUES(1,1.79543191343500614168e+09,'cancel-job','alice','f20d3939d998459885c99881e9c824b3','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.79543191343798351281e+09,'delete-job','alice','f20d3939d998459885c99881e9c824b3',NULL,'command line',NULL);
CREATE TABLE datasets (
	owner VARCHAR(64) NOT NULL, 
	id VARCHAR(48) NOT NULL, 
	name VARCHAR(255) NOT NULL, 
	suffix VARCHAR(16) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	bytes BIGINT NOT NULL, 
	preview TEXT NOT NULL, 
	created FLOAT NOT NULL, summary TEXT, deleted FLOAT, source TEXT, idle_since FLOAT, 
	CONSTRAINT pk_datasets PRIMARY KEY (owner, id)
);
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79543191339899754527e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL,'https://example.org/a.csv',NULL);
CREATE TABLE deliveries (
	id VARCHAR(32) NOT NULL, 
	webhook_id VARCHAR(32) NOT NULL, 
	event VARCHAR(32) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	body TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	attempts INTEGER NOT NULL, 
	next_at FLOAT, 
	attempted FLOAT, 
	delivered FLOAT, 
	status INTEGER, 
	error TEXT, 
	CONSTRAINT pk_deliveries PRIMARY KEY (id), 
	CONSTRAINT fk_deliveries_webhook_id FOREIGN KEY(webhook_id) REFERENCES webhooks (id) ON DELETE CASCADE
);
INSERT INTO "deliveries" VALUES('6e67b342a5a14043be4c319c2e2b754b','a15d6d780f2643bfb4896a4c3e0f8daf','job.succeeded','08d82dc45ba14474bdea73933302fbb0','{"type":"job.succeeded","timestamp":"2026-11-23T11:05:13.422+00:00","data":{"job":"08d82dc45ba14474bdea73933302fbb0","kind":"identification","name":"it''s done; really","state":"succeeded","links":{"job":"/v1/jobs/08d82dc45ba14474bdea73933302fbb0","result":"/v1/jobs/08d82dc45ba14474bdea73933302fbb0/result","report":"/v1/jobs/08d82dc45ba14474bdea73933302fbb0/report"}}}',1.79543191342201089851e+09,0,1.79543191342201089851e+09,NULL,NULL,NULL,NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('e71e384af2df413686f0f86e46fdcd12',1,'queued','{}',1.79543191340599799163e+09);
INSERT INTO "events" VALUES('e71e384af2df413686f0f86e46fdcd12',2,'cancelled','{}',1.79543191340800976753e+09);
INSERT INTO "events" VALUES('08d82dc45ba14474bdea73933302fbb0',1,'queued','{}',1.7954319134119927883e+09);
INSERT INTO "events" VALUES('08d82dc45ba14474bdea73933302fbb0',2,'running','{"attempt": 1}',1.79543191341798758506e+09);
INSERT INTO "events" VALUES('08d82dc45ba14474bdea73933302fbb0',3,'progress','{"generation": 3}',1.79543191341999912261e+09);
INSERT INTO "events" VALUES('08d82dc45ba14474bdea73933302fbb0',4,'succeeded','{"best": 0.5}',1.79543191342201089851e+09);
INSERT INTO "events" VALUES('6f8bbf9d840a4f33975f4c5537738131',1,'queued','{}',1.79543191342599391937e+09);
INSERT INTO "events" VALUES('6f8bbf9d840a4f33975f4c5537738131',2,'running','{"attempt": 1}',1.79543191342800569532e+09);
INSERT INTO "events" VALUES('6f8bbf9d840a4f33975f4c5537738131',3,'progress','{"generation": 3}',1.79543191342901134487e+09);
INSERT INTO "events" VALUES('6f8bbf9d840a4f33975f4c5537738131',4,'failed','{"type": "broken", "detail": "it broke"}',1.79543191343098282818e+09);
INSERT INTO "events" VALUES('f0468b38faf94b00a2f0c8af84bbe894',1,'queued','{}',1.79543191343198871613e+09);
INSERT INTO "events" VALUES('f0468b38faf94b00a2f0c8af84bbe894',2,'cancelled','{}',1.79543191343299436569e+09);
INSERT INTO "events" VALUES('63f31034af2248dd824869e0b7f17dc2',1,'queued','{}',1.79543191343798351281e+09);
INSERT INTO "events" VALUES('63f31034af2248dd824869e0b7f17dc2',2,'running','{"attempt": 1}',1.79543191343999505044e+09);
INSERT INTO "events" VALUES('63f31034af2248dd824869e0b7f17dc2',3,'progress','{"generation": 5}',1.79543191344301247599e+09);
INSERT INTO "events" VALUES('50f1eb72161747e8998990630ab95da6',1,'queued','{}',1.79543191344401836394e+09);
CREATE TABLE jobs (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255), 
	priority INTEGER NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	version BIGINT NOT NULL, 
	attempt INTEGER NOT NULL, 
	stalled INTEGER NOT NULL, 
	lease_owner VARCHAR(128), 
	lease_epoch BIGINT NOT NULL, 
	lease_until FLOAT NOT NULL, 
	cancel_requested BOOLEAN NOT NULL, 
	progress TEXT, 
	checkpoint VARCHAR(64), 
	summary TEXT, 
	problem TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	started FLOAT, 
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, islands INTEGER DEFAULT 1 NOT NULL, monitor_id VARCHAR(32), record_number BIGINT, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('e71e384af2df413686f0f86e46fdcd12','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79543191340599799163e+09,1.79543191340800976753e+09,NULL,1.79543191340800976753e+09,'0.1.0',NULL,NULL,0.0,'',1,'fa8fea6ca9a749ecb69c6564b22a8c72',1);
INSERT INTO "jobs" VALUES('08d82dc45ba14474bdea73933302fbb0','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79543551341798758502e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.7954319134119927883e+09,1.79543191342201089851e+09,1.79543191341798758506e+09,1.79543191342201089851e+09,'0.1.0','0.1.0','0.1.0',0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('6f8bbf9d840a4f33975f4c5537738131','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79543551342800569532e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79543191342599391937e+09,1.79543191343098282818e+09,1.79543191342800569532e+09,1.79543191343098282818e+09,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('f0468b38faf94b00a2f0c8af84bbe894','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79543191343198871613e+09,1.79543191343299436569e+09,NULL,1.79543191343299436569e+09,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('63f31034af2248dd824869e0b7f17dc2','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,0,'e935a910384f48498c2045d644bcf041',1,1.79543191243999505045e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79543191343798351281e+09,1.79543191344301247599e+09,1.79543191343999505044e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('50f1eb72161747e8998990630ab95da6','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79543191344401836394e+09,1.79543191344401836394e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL);
CREATE TABLE keys (
	id VARCHAR(16) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	secret_sha256 VARCHAR(64) NOT NULL, 
	scopes TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	expires FLOAT, 
	revoked FLOAT, 
	CONSTRAINT pk_keys PRIMARY KEY (id), 
	CONSTRAINT uq_keys_secret_sha256 UNIQUE (secret_sha256)
);
INSERT INTO "keys" VALUES('81aae53ddbc5276b','alice','revoked','d194218d15d87b046f84b298238aee607e3b752ef0330a30c6df61c4868b383e','["read", "write"]',1.79543191339501428602e+09,1.79543551339501428597e+09,1.79543191339698576924e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('08d82dc45ba14474bdea73933302fbb0',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('08d82dc45ba14474bdea73933302fbb0',2,'{"fitness": 0.7}','second');
CREATE TABLE monitor_records (
	monitor_id VARCHAR(32) NOT NULL, 
	is_rejected BOOLEAN NOT NULL, 
	place BIGINT NOT NULL, 
	name TEXT NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	state TEXT NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_monitor_records PRIMARY KEY (monitor_id, is_rejected, place), 
	CONSTRAINT fk_monitor_records_monitor_id_monitors FOREIGN KEY(monitor_id) REFERENCES monitors (id) ON DELETE CASCADE
);
INSERT INTO "monitor_records" VALUES('fa8fea6ca9a749ecb69c6564b22a8c72',0,0,'record 4','0000000000000000000000000000000000000000000000000000000000000004','4','{"index": 0, "name": "record 4", "sha256": "0000000000000000000000000000000000000000000000000000000000000004"}');
CREATE TABLE monitors (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	priority INTEGER NOT NULL, 
	version BIGINT NOT NULL, 
	submitted BIGINT NOT NULL, 
	status VARCHAR(16) NOT NULL, 
	records BIGINT NOT NULL, 
	alarms BIGINT NOT NULL, 
	state TEXT, 
	document TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	islands_version VARCHAR(64), start BIGINT DEFAULT 0 NOT NULL, last_alarm TEXT, 
	CONSTRAINT pk_monitors PRIMARY KEY (id)
);
INSERT INTO "monitors" VALUES('fa8fea6ca9a749ecb69c6564b22a8c72','alice','press','{"input": "u"}',0,1,1,'normal',1,0,'{"schema": "islands.monitor-head/1", "state": {"records": []}, "rejected": []}','{"count": 1}',1.79543191340201497077e+09,1.79543191340998125075e+09,'0.1.0',0,NULL);
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, dataset_retention BIGINT, max_islands BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('08d82dc45ba14474bdea73933302fbb0',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('6f8bbf9d840a4f33975f4c5537738131',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('63f31034af2248dd824869e0b7f17dc2',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('08d82dc45ba14474bdea73933302fbb0','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','f20d3939d998459885c99881e9c824b3','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79543191343500614168e+09);
CREATE TABLE webhooks (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	url TEXT NOT NULL, 
	events TEXT NOT NULL, 
	secret VARCHAR(64) NOT NULL, 
	created FLOAT NOT NULL, 
	busy_until FLOAT DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_webhooks PRIMARY KEY (id)
);
INSERT INTO "webhooks" VALUES('a15d6d780f2643bfb4896a4c3e0f8daf','alice','https://hooks.example.org/a','["job.succeeded"]','whsec_IF8Uppccq+Ho7ffI62KlGdtY0yimryV9NvpUSoCX04A=',1.79543191340100908278e+09,0.0);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_webhooks_owner ON webhooks (owner);
CREATE INDEX ix_deliveries_webhook_id_next_at ON deliveries (webhook_id, next_at);
CREATE INDEX ix_deliveries_webhook_id_created ON deliveries (webhook_id, created);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id, islands);
CREATE INDEX ix_monitors_owner_created_id ON monitors (owner, created, id);
CREATE INDEX ix_jobs_monitor ON jobs (monitor_id, state, record_number) WHERE monitor_id IS NOT NULL;
CREATE INDEX ix_monitor_records_monitor_id_sha256 ON monitor_records (monitor_id, sha256);
COMMIT;
